"""The cost of a search by generation, counting missions that affect it, and scores by cost."""

import argparse
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from evoros.base.errors import InputError
from evoros.mission.plan import SEARCHING

from .champions import require_row
from .designs import place_candidates, read_generations, select_bests, trace_fitness
from .records import Record
from .study import Study

GENERATION, PROCESSOR = "generation", "processor_s"
AXES: Mapping[str, str] = {
    GENERATION: "generation",
    "missions": "missions",
    "simulated_s": "simulated time [s]",
    PROCESSOR: "processor time [s]",
}
"""Titles of the axes, which are the columns of the same names."""
Span = tuple[float, float]  # cost from which all runs have a design, and the budget


def read_costs(record: Record, axis: str) -> "pd.Series[Any]":
    """Read the cumulative cost at the end of each generation."""
    numbers = sorted(read_generations(record)["generation"].unique())
    if axis == GENERATION:
        return pd.Series(numbers, numbers)
    if axis == PROCESSOR:
        known = record.run.status.get(PROCESSOR, ())
        if len(known) < len(numbers) or not max(known):
            others = ", ".join(name for name in AXES if name != PROCESSOR)
            raise InputError(
                f"--axis {PROCESSOR}: {record.path} did not record the processor time of each "
                f"generation; choose from {others}"
            )
        return pd.Series(known[: len(numbers)], numbers, dtype=float)
    missions = record.run.missions
    groups = missions[missions["purpose"].isin(SEARCHING)].groupby("generation")
    costs = groups.size() if axis == "missions" else groups["time_s"].sum()
    return costs.reindex(numbers, fill_value=0).cumsum()


def add_costs(study: Study, axis: str) -> pd.DataFrame:
    """Return the candidates of all generations and runs, with a column for the cost."""
    table = study.generations
    if axis == GENERATION:
        return table
    known = {record.name: read_costs(record, axis) for record in study.records}
    pairs = zip(table["run"], table["generation"], strict=True)
    return table.assign(**{axis: [known[run][generation] for run, generation in pairs]})


def trace_costs(generations: pd.DataFrame, axis: str) -> pd.DataFrame:
    """Trace the fitness of a run over its cost, as ``trace_fitness`` does over generations."""
    traced = trace_fitness(generations)
    if axis != GENERATION:
        traced.index = pd.Index(generations.groupby("generation")[axis].first(), name=axis)
    return traced[~traced.index.duplicated(keep="last")]  # a generation may run no missions


def compute_quartiles(generations: pd.DataFrame, axis: str = GENERATION) -> pd.DataFrame:
    """Compute quartiles over the runs, one row per treatment and cost at the end of a generation.

    Until its end, each run contributes its last generation completed within that cost.
    ``validated_replicates`` is the number of runs that validated the best candidate of that
    generation.
    """
    tables = []
    for treatment in dict.fromkeys(generations["treatment"]):
        rows = generations[generations["treatment"] == treatment]
        traces = [trace_costs(run, axis) for _, run in rows.groupby("run")]
        costs = np.unique(np.concatenate([trace.index for trace in traces]))
        held = [
            trace.reindex(
                costs[(trace.index[0] <= costs) & (costs <= trace.index[-1])], method="ffill"
            )
            for trace in traces
        ]
        grouped = pd.concat(held).rename_axis(axis).groupby(axis)
        table = grouped["recorded"].count().to_frame("replicates")
        table["validated_replicates"] = grouped["validated"].count()
        for line in map(str, traces[0]):
            for name, share in (("q1", 0.25), ("median", 0.5), ("q3", 0.75)):
                table[f"{line}_{name}"] = grouped[line].quantile(share)
        table.insert(0, "treatment", treatment)
        tables.append(table.reset_index())
    table = pd.concat(tables, ignore_index=True)
    return table[["treatment", axis, *table.columns.difference(["treatment", axis], sort=False)]]


def add_axis(parser: argparse.ArgumentParser, default: str | None = GENERATION) -> None:
    """Add ``--axis``, the measure of a search's cost."""
    about = "measure of cost by which to compare searches"
    parser.add_argument("--axis", choices=AXES, default=default, help=about)


def add_budget(parser: argparse.ArgumentParser) -> None:
    """Add ``--axis`` and ``--budget``, for comparing searches at equal cost."""
    add_axis(parser, None)
    about = "cost for comparing searches, in units of --axis; default: lowest total cost of a run"
    parser.add_argument("--budget", type=float, metavar="COST", help=about)


def read_best_within(record: Record, axis: str, budget: float) -> pd.DataFrame:
    """Read the sensors of the best design in the last generation within a budget."""
    costs = read_costs(record, axis)
    last = costs.index[costs <= budget].max()
    row = select_bests(read_generations(record)).loc[[last]].reset_index()
    return require_row(place_candidates(row, record))


def check_axis(options: argparse.Namespace) -> None:
    """Check that ``--axis`` is given for options that depend on it."""
    for name in ("budget", "target"):
        if options.axis is None and getattr(options, name, None) is not None:
            raise InputError(f"--{name}: needs the option --axis; add --axis missions")


def find_span(costs: Mapping[str, "pd.Series[float]"], axis: str, budget: float | None) -> Span:
    """Return the cost from which all runs have a design, and the budget that all runs reach."""
    firsts = {run: float(known.iloc[0]) for run, known in costs.items()}
    lasts = {run: float(known.iloc[-1]) for run, known in costs.items()}
    late, short = max(firsts, key=firsts.__getitem__), min(lasts, key=lasts.__getitem__)
    start, end = firsts[late], lasts[short]
    if start > end:
        raise InputError(
            f"--axis {axis}: the first generation of {late} cost {start:g}, more than the whole "
            f"run {short} ({end:g}); leave out one of these runs with --where"
        )
    if budget is not None and not (start <= budget <= end and budget > 0):
        raise InputError(
            f"--budget: must be from {start:g} (the first generation of {late}) to {end:g} (the "
            f"end of {short}), and above 0, not {budget:g}; change the budget, or extend that run"
        )
    return start, end if budget is None else budget


def average(trace: "pd.Series[float]", span: Span) -> float:
    """Return the mean over a span of costs; ``trace`` has the value from each cost to the next."""
    start, end = span
    inside = trace.index[(trace.index > start) & (trace.index < end)].to_numpy(float)
    edges = np.array([start, *inside, end])
    values = trace.reindex(edges[:-1], method="ffill").to_numpy(float)
    return float(np.average(values, weights=np.diff(edges))) if end > start else float(values[0])


def find_first(trace: "pd.Series[float]", target: float) -> float:
    """Return the cost at which a run first reaches the target; infinity if never."""
    reached = trace.index[trace >= target]
    return float(reached[0]) if len(reached) else np.inf


@dataclass(frozen=True)
class Race:
    """A comparison of a study's searches at equal cost."""

    axis: str
    line: str  # ``validated``, or ``recorded`` unless every generation was validated
    span: Span
    target: float | None
    runs: pd.DataFrame  # one row per run: ``measure`` and, with a target, ``reached``

    @property
    def measure(self) -> str:
        """The name of the mean fitness over the axis."""
        return f"mean over {AXES[self.axis].partition(' [')[0]}"

    @property
    def reached(self) -> str:
        """The column of the cost at which a run reached the target, empty if never."""
        return f"reached_{self.axis}"


def hold_race(study: Study, axis: str, budget: float | None, target: float | None) -> Race:
    """Score each run by its mean best fitness over the cost, up to a common budget."""
    costs = {record.name: read_costs(record, axis) for record in study.records}
    span, table = find_span(costs, axis, budget), add_costs(study, axis)
    traces = {str(run): trace_costs(rows, axis) for run, rows in table.groupby("run")}
    validated = all(trace["validated"].notna().all() for trace in traces.values())
    line = "validated" if validated else "recorded"

    def score(record: Record) -> pd.DataFrame:
        trace = traces[record.name][line]
        row = {race.measure: average(trace, span)}
        if target is not None:
            cost = find_first(trace, target)
            row[race.reached] = cost if cost <= span[1] else np.nan
        return pd.DataFrame([row])

    race = Race(axis, line, span, target, pd.DataFrame())
    race = replace(race, runs=study.gather(score))
    if target is not None and race.runs[race.reached].isna().all():
        best = max(float(trace[line].loc[: span[1]].max()) for trace in traces.values())
        raise InputError(
            f"--target: no run reaches {target:g} by {span[1]:g} {AXES[axis]}; the highest "
            f"{line} fitness is {best:.4g}; choose a lower target or a larger --budget"
        )
    return race
