"""The user's claims from a file, judged by replicates, intervals and random designs."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from evoros.base.arrays import Array
from evoros.base.checks import is_number
from evoros.base.errors import InputError
from evoros.fitness.naming import UNBOUNDED

from ..designs.features import describe_designs
from ..statistics import finding
from ..statistics.factorial import contrast_interval
from ..statistics.small_samples import NOTHING, Interval, mean_interval, share_interval
from ..tables.champions import read_champion
from ..tables.designs import read_generations, select_random, trace_fitness
from ..tables.factors import name_part
from ..tables.records import Record, bound_scores
from ..tables.study import Study
from ..tables.treatments import Conditions, read_entries, read_levels, select_rows
from ..tables.validated import list_missions, list_random_missions, validate_champions

ABOVE, BELOW, WITHIN = "above", "below", "within"
KEYS = ("claim", "measure", "comparison", "threshold", "treatments", "against")
REQUIRED = ("claim", "measure", "comparison")
FEATURES = ("sensors", "ahead", "redundant", "closest_m", "lost")  # columns of ``describe_designs``
FITNESS = ("recorded", "validated")
GAINS = ("gain_recorded", "gain_validated")
COMPLETED = "completed"
TITLES = {
    "recorded": "recorded fitness",
    "validated": "validated fitness",
    COMPLETED: "completed missions",
    "gain_recorded": "gain in recorded fitness",
    "gain_validated": "gain in validated fitness",
    "ahead": "share of the cones within 30 deg of straight ahead",
    "redundant": "champions with a redundant pair",
    "closest_m": "minimum distance between two sensors [m]",
    "lost": "sensors lost to damage",
}
SHARES = (COMPLETED, "ahead", "redundant")
NAMED = (*FITNESS, COMPLETED, *GAINS, *FEATURES)
Near = tuple[float, float]  # redundancy thresholds: distance [m] and angle [deg]


@dataclass(frozen=True)
class Group:
    """The treatments of a claim, selected by factor levels or by labels."""

    conditions: Conditions
    labels: tuple[str, ...] = ()

    def select(self, study: Study, place: str) -> list[Record]:
        """Return the finished runs of these treatments."""
        unknown = [label for label in self.labels if label not in study.treatments]
        if unknown:
            raise InputError(
                f"{place}: treatment {unknown[0]!r} not found; choose among "
                f"{'; '.join(study.treatments)}"
            )
        rows = select_rows(study.records, self.conditions, place)
        return [
            record
            for record, fits in zip(study.records, rows, strict=True)
            if fits and (not self.labels or record.treatment in self.labels)
        ]

    def describe(self) -> str:
        """Describe the treatments; empty for all treatments."""
        parts = [f"{name} {' or '.join(levels)}" for name, levels in self.conditions.items()]
        return ", ".join([*self.labels, *parts]).replace("_", " ")


@dataclass(frozen=True)
class OwnClaim:
    """An entry in a file of claims."""

    text: str
    measure: str
    comparison: str  # ``ABOVE``, ``BELOW`` or ``WITHIN``
    low: float  # the threshold; for ``WITHIN``, the lower threshold
    high: float
    treatments: Group
    against: Group | None  # group from which the difference is claimed, if any
    place: str  # prefix of error messages


def read_claims(path: Path) -> list[OwnClaim]:
    """Read claims from a YAML file."""
    entries = read_entries(path, "claims", ", ".join(REQUIRED), "- claim: ...")
    return [_read(entry, f"{path}, entry {i}") for i, entry in enumerate(entries, 1)]


def _read(entry: object, place: str) -> OwnClaim:
    if not isinstance(entry, dict):
        raise InputError(
            f"{place}: not a mapping; start it with - claim: and add keys from {', '.join(KEYS)}"
        )
    for key in entry:
        if key not in KEYS:
            raise InputError(
                f"{place}: unknown key {key!r}; remove it, or use one of {', '.join(KEYS)}"
            )
    for key in REQUIRED:
        if not isinstance(entry.get(key), str) or not entry[key].strip():
            raise InputError(f"{place}: {key} must be a string, not {entry.get(key)!r}")
    comparison = entry["comparison"]
    if comparison not in (ABOVE, BELOW, WITHIN):
        raise InputError(
            f"{place}: comparison must be one of {ABOVE}, {BELOW}, {WITHIN}, not {comparison!r}"
        )
    against = _read_group(entry["against"], f"{place}: against") if "against" in entry else None
    bounds = _read_bounds(entry.get("threshold"), comparison, against is not None, place)
    treatments = _read_group(entry.get("treatments", {}), f"{place}: treatments")
    text, measure = entry["claim"].strip(), entry["measure"].strip()
    return OwnClaim(text, measure, comparison, *bounds, treatments, against, place)


def _read_bounds(
    given: object, comparison: str, difference: bool, place: str
) -> tuple[float, float]:
    if given is None and difference and comparison != WITHIN:
        return 0.0, 0.0
    bounds = given if comparison == WITHIN else [given, given]
    numbers = bounds if isinstance(bounds, list) and all(map(is_number, bounds)) else []
    if len(numbers) != 2 or numbers[0] > numbers[1]:
        rule = "two numbers, [low, high]" if comparison == WITHIN else "a number"
        raise InputError(f"{place}: threshold must be {rule}, not {given!r}")
    return float(numbers[0]), float(numbers[1])


def _read_group(given: object, place: str) -> Group:
    if isinstance(given, Mapping):
        return Group(read_levels(given))
    labels = [given] if isinstance(given, str) else given
    if isinstance(labels, list) and labels and all(isinstance(name, str) for name in labels):
        return Group({}, tuple(labels))
    raise InputError(
        f"{place} must map factors to levels, as in {{failure: none}}, or list treatment labels, "
        f"not {given!r}"
    )


def judge_own(claim: OwnClaim, study: Study, near: Near) -> finding.Finding:
    """Judge a claim on the finished runs of its treatments.

    The value is the mean over the champions, or the difference between two such means. A claim is
    supported if the interval lies beyond the threshold, and if the champions differ from the random
    designs of their runs in this direction too.
    """
    values = measure_runs(claim.measure, study, near, claim.place)
    groups = [claim.treatments, *([claim.against] if claim.against else [])]
    sides = []
    for group in groups:
        names = [record.name for record in group.select(study, claim.place)]
        sides.append(values[values.index.isin(names) & values.value.notna()])
    about = " minus ".join(filter(None, (group.describe() or "all runs" for group in groups)))
    unit = finding.SHARE if claim.measure in SHARES else finding.NUMBER
    stated = finding.Claim(claim.text, f"{title_measure(claim.measure)}, {about}", unit)
    if min(map(len, sides)) < 2:
        return stated.lack(f"at least two finished runs with {claim.measure} for {about}")
    samples = [side.value.to_numpy(float) for side in sides]
    measured = _estimate(samples, bounds=_bound_values(claim.measure, study))
    verdict = finding.require_replicates(_judge(claim, measured), *map(len, sides))
    reference = claim.low if claim.low == claim.high else np.nan
    bounds = dict.fromkeys((f"{claim.low:g}", f"{claim.high:g}"))
    why = f"{claim.comparison} {' to '.join(bounds)}"
    rate, excess = _compare_with_random(sides)
    if not np.isnan(excess.value):
        why += f"; over random designs {excess.value:+.2g} [{excess.low:.2g}, {excess.high:.2g}]"
        above, below = excess.low > 0, excess.high < 0
        beyond = {ABOVE: above, BELOW: below}.get(claim.comparison, above or below)
        verdict, why = finding.require_beyond_random(verdict, why, beyond)
    judged, n = (verdict, why), min(map(len, sides))
    return stated.conclude(measured, n, judged, finding.Against(reference, rate))


def title_measure(measure: str) -> str:
    """Return the name of a measure for messages."""
    return TITLES.get(measure, measure.rpartition(".")[2].replace("_", " "))


def _compare_with_random(sides: Sequence[pd.DataFrame]) -> tuple[float, Interval]:
    """Return the value of random designs and the champions' gain; NaN if there are none."""
    random = [side.random.to_numpy(float) for side in sides]
    if any(np.isnan(drawn).any() for drawn in random):
        return np.nan, NOTHING
    rate = float(random[0].mean() - sum(drawn.mean() for drawn in random[1:]))
    pairs = zip(sides, random, strict=True)
    return rate, _estimate(
        [side.value.to_numpy(float) - drawn for side, drawn in pairs], plain=True
    )


def _estimate(
    samples: Sequence[Array], plain: bool = False, bounds: tuple[float, float] = UNBOUNDED
) -> Interval:
    if len(samples) == 2:
        return contrast_interval(samples, [1.0, -1.0], bounds)
    (sample,) = samples
    if not plain and set(sample) <= {0.0, 1.0}:
        return share_interval(int(sample.sum()), sample.size)
    return mean_interval(sample)


def _bound_values(measure: str, study: Study) -> tuple[float, float]:
    if measure in FITNESS:
        return bound_scores(study.records)
    return (0.0, 1.0) if measure in SHARES else UNBOUNDED


def _judge(claim: OwnClaim, measured: Interval) -> str:
    if claim.comparison == ABOVE:
        return finding.judge_above(measured, claim.high)
    if claim.comparison == BELOW:
        return finding.judge_above(-measured, -claim.low)
    return finding.judge_within(measured, claim.low, claim.high)


def measure_runs(measure: str, study: Study, near: Near, place: str) -> pd.DataFrame:
    """Return one row per run: the champion's ``value``, and the mean of ``random`` designs."""
    readers: Mapping[str, Callable[[], pd.DataFrame]] = {
        **dict.fromkeys(FITNESS, lambda: _measure_fitness(measure, study)),
        **dict.fromkeys(GAINS, lambda: _measure_gain(measure, study)),
        **dict.fromkeys(FEATURES, lambda: _measure_feature(measure, study, near)),
        COMPLETED: lambda: _measure_completion(study),
    }
    if measure in readers:
        return readers[measure]()
    tables = (read_generations(record).select_dtypes("number") for record in study.records)
    columns = dict.fromkeys(str(name) for table in tables for name in table)
    if measure not in columns:
        recorded = [name for name in columns if name.startswith(("objectives.", "descriptors."))]
        raise InputError(
            f"{place}: measure must be one of {', '.join((*NAMED, *recorded))}, or another "
            f"numeric column of the generations' tables, not {measure!r}"
        )
    return _collect(study, lambda record: _read_column(record, measure))


def _collect(study: Study, read: Callable[[Record], tuple[float, float]]) -> pd.DataFrame:
    rows = {record.name: read(record) for record in study.records}
    return pd.DataFrame.from_dict(rows, orient="index", columns=["value", "random"])


def _read_column(record: Record, column: str) -> tuple[float, float]:
    table = read_generations(record)
    if column not in table:
        return np.nan, np.nan
    champion = table[table.id == record.run.champion.design.iloc[0]][column]
    drawn = select_random(table)[column]
    return float(champion.iloc[-1]) if len(champion) else np.nan, float(drawn.mean())


def _measure_fitness(measure: str, study: Study) -> pd.DataFrame:
    champions = validate_champions(study).set_index("run")[measure].to_dict()

    def read(record: Record) -> tuple[float, float]:
        first = trace_fitness(record.run.generations)[measure].iloc[0]
        return float(champions.get(record.name, np.nan)), float(first)

    return _collect(study, read)


def _measure_gain(measure: str, study: Study) -> pd.DataFrame:
    """Return the gain of the best design from the first to the last generation of each run."""

    def read(record: Record) -> tuple[float, float]:
        line = trace_fitness(record.run.generations)[measure.removeprefix("gain_")]
        return float(line.iloc[-1] - line.iloc[0]), np.nan

    return _collect(study, read)


def _measure_feature(measure: str, study: Study, near: Near) -> pd.DataFrame:
    table = describe_designs(study.gather(read_champion), study.initial, study.rings, *near)
    table = table.assign(value=table[measure].astype(float))
    best, drawn = (table[table.random == flag].groupby("run").value.mean() for flag in (0, 1))
    return _collect(study, lambda r: (best.get(r.name, np.nan), drawn.get(r.name, np.nan)))


def _measure_completion(study: Study) -> pd.DataFrame:
    missions, drawn = list_missions(study), list_random_missions(study)

    def read(record: Record) -> tuple[float, float]:
        simulator = name_part("simulator", record.values, record.choices)
        sources = ("validated in the run", f"evaluated in {simulator}")
        flown = missions[(missions.run == record.name) & missions.source.isin(sources)]
        return float(flown.completed.mean()), float(
            drawn[drawn.run == record.name].completed.mean()
        )

    return _collect(study, read)
