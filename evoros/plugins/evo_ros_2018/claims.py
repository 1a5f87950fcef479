"""Tests the paper's claims, or claims from a file, by the rules in ``docs/claims.md``."""

import argparse
from collections.abc import Callable, Iterator
from dataclasses import astuple
from itertools import pairwise

import numpy as np
import pandas as pd
from scipy.signal import find_peaks

from evoros.analysis.designs.features import DESIGN, HEADINGS_DEG, describe_designs, paper_rings
from evoros.analysis.figures import claims as own_claims
from evoros.analysis.figures.options import check_thresholds
from evoros.analysis.statistics import finding, small_samples
from evoros.analysis.subcommands import Product
from evoros.analysis.tables.champions import read_champion
from evoros.analysis.tables.designs import trace_fitness
from evoros.analysis.tables.records import Record
from evoros.analysis.tables.study import Study
from evoros.analysis.tables.validated import classify_failure, list_missions, list_random_missions
from evoros.base.arrays import Array
from evoros.plugins.evo_ros_2018 import claims_designs
from evoros.plugins.evo_ros_2018.claims_designs import RANDOM, SPATIAL, read_diversity

_PROMINENCE_DEG = 3.0  # prominence below which extrema of the heading are corrections
_SETTLING = 1  # turning points ignored after a waypoint or an avoidance, while the robot realigns
FIRST_ROBOT, HELP = own_claims.FIRST_ROBOT, own_claims.HELP
NEEDS, FILES = own_claims.NEEDS, own_claims.FILES
add_arguments = own_claims.add_arguments
WEAVING = ".Serpentine"  # end of the class names of navigation layers that weave by design
_NO_DESIGNS = pd.DataFrame(
    columns=[*DESIGN, "random", "strategy", "redundant", "closest_m", "kind", *HEADINGS_DEG]
).astype({"random": bool, "redundant": bool})
EARLY = 15  # number of generations after which the paper found most of the gain
SWING_DEG = 60.0
EARLY_TEXT = f"Most increases in fitness take place during the first {EARLY} generations"
GAIN = {
    name: finding.Claim(EARLY_TEXT, f"share of the gain reached by generation {EARLY}, {name}")
    for name in ("recorded", "validated")
}
APPROACH = finding.Claim(
    "The average fitness approaches the fitness of the fittest",
    "distance between mean and best fitness, last generation divided by first",
)
SWING = finding.Claim(
    "While the robot drives to a waypoint, its heading swings through an arc of up to 60 deg",
    "swing of the heading about the course, median",
    finding.DEGREES,
)
COMPLETED = "Even in the presence of sensor failure, missions are completed"


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Test the claims on all finished runs of the study and on evaluations of their champions."""
    if options.claims is not None:
        return own_claims.make_product(study, options)
    check_thresholds(options)
    reads = *own_claims.READS, _read_champion_swings, read_diversity, read_gains
    study = study.select_finished(*reads)
    pooled = _report_pooled(study)
    return own_claims.tabulate_findings(judge_claims(study, options), study, options, pooled)


def judge_claims(study: Study, options: argparse.Namespace) -> Iterator[finding.Finding]:
    """Test all claims on the finished runs of a study."""
    mirrored = study.keep(record for record in study.records if record.context.mirrored)
    free = study.keep(record for record in study.records if not record.context.mirrored)
    designs, free_designs = _describe(mirrored, options), _describe(free, options)
    yield claims_designs.judge_configurations(designs)
    yield claims_designs.judge_redundancy(designs)
    for ring in study.rings or paper_rings():
        yield claims_designs.judge_damage_clusters(designs, ring.radius_m)
    gains = _gather(mirrored, read_gains)
    for line in GAIN:
        yield judge_gain(gains, line)
    yield judge_approach(gains)
    yield from _judge_swings(mirrored)
    yield from judge_completion(list_missions(study), list_random_missions(study))
    kinds = set(map(classify_failure, free.records))
    comparable = mirrored.keep(r for r in mirrored.records if classify_failure(r) in kinds)
    yield claims_designs.judge_spread_between(designs[designs.kind.isin(kinds)], free_designs)
    diversity = (_gather(part, read_diversity) for part in (comparable, free))
    yield claims_designs.judge_spread_within(*diversity)


def _judge_swings(mirrored: Study) -> Iterator[finding.Finding]:
    """Test the claim on heading swings, separately for controllers that weave by design."""
    weaving = mirrored.keep(record for record in mirrored.records if _weaves(record))
    others = mirrored.keep(record for record in mirrored.records if not _weaves(record))
    if others.records or not weaving.records:
        yield judge_heading_swing(_gather(others, _read_champion_swings))
    if weaving.records:
        yield judge_heading_swing(_gather(weaving, _read_champion_swings), built_in=True)


def _weaves(record: Record) -> bool:
    return str(record.values.get("controller.navigation._target_", "")).endswith(WEAVING)


def _gather(study: Study, read: Callable[[Record], pd.DataFrame]) -> pd.DataFrame:
    if any(len(read(record)) for record in study.records):
        return study.gather(read)
    return pd.DataFrame(columns=["first", "last"])


def _describe(study: Study, options: argparse.Namespace) -> pd.DataFrame:
    if not study.records:
        return _NO_DESIGNS
    near = options.near_m, options.near_deg
    table = describe_designs(study.gather(read_champion), study.initial, study.rings, *near)
    kinds = {record.name: classify_failure(record) for record in study.records}
    return table.assign(kind=table.run.map(kinds))


def _report_pooled(study: Study) -> Iterator[str]:
    mirrored = [record for record in study.records if record.context.mirrored]
    for kind in dict.fromkeys(map(classify_failure, mirrored)):
        labels = dict.fromkeys(r.treatment for r in mirrored if classify_failure(r) == kind)
        if len(labels) > 1:
            yield f"failure {kind}: runs of several treatments are pooled: {'; '.join(labels)}"


def measure_swings(trajectory: pd.DataFrame, mode: int) -> list[float]:
    """Return the swing [deg] of the heading about the course at each turning point.

    Only sections in ``mode`` between two waypoints are used. A swing is the distance of an extremum
    from the mean of its two neighbours, so steady turns do not count. The swing of ``A sin(w t) + c
    t`` is ``2 A (1 + d^2 / 2)`` to second order in ``d = c / (A w)``.
    """
    yaw = np.degrees(np.unwrap(trajectory.yaw_rad.to_numpy(float)))
    if len(yaw) < 3:
        return []
    state = np.stack([trajectory["mode"].to_numpy() == mode, trajectory.visited.to_numpy()])
    changes = np.flatnonzero((state[:, 1:] != state[:, :-1]).any(axis=0)) + 1
    swings: list[float] = []
    for begin, end in pairwise([0, *changes.tolist(), len(yaw)]):
        if state[0, begin]:
            turns = _turning_points(yaw[begin:end])[_SETTLING:]
            swings += np.abs(turns[1:-1] - (turns[:-2] + turns[2:]) / 2).tolist()
    return swings


def _turning_points(yaw: Array) -> Array:
    extrema = [find_peaks(sign * yaw, prominence=_PROMINENCE_DEG)[0] for sign in (1, -1)]
    return np.asarray(yaw[np.sort(np.concatenate(extrema))])


def _read_champion_swings(record: Record) -> pd.DataFrame:
    """Return the world and swing [deg] of each turning point while the last layer navigates."""
    rows = [
        (world, swing)
        for world in record.context.courses
        for swing in measure_swings(record.run.trajectory(world), len(record.context.modes))
    ]
    return pd.DataFrame(rows, columns=["world", "swing_deg"])


def read_gains(record: Record) -> pd.DataFrame:
    """Return a run's recorded and validated fitness, and the gap from best to mean, as a row.

    Columns end in ``_first``, ``_early`` or ``_last``; ``last`` is the last generation.
    """
    traced = trace_fitness(record.run.generations)
    first, last = traced.index[0], traced.index[-1]
    row: dict[str, object] = {"last": int(last)}
    for name, generation in {"first": first, "early": min(EARLY, last), "last": last}.items():
        for line in GAIN:
            row[f"{line}_{name}"] = traced.loc[generation, line]
        row[f"gap_{name}"] = traced.loc[generation, "recorded"] - traced.loc[generation, "mean"]
    return pd.DataFrame([row])


def judge_gain(table: pd.DataFrame, line: str) -> finding.Finding:
    """Test which fraction of the gain is reached early; ``table`` is from ``read_gains``."""
    claim = GAIN[line]
    names = [f"{line}_{name}" for name in ("first", "early", "last")]
    # an empty table has no columns
    known = table[table["last"] > EARLY].dropna(subset=names) if len(table) else table
    if len(known) < 2:
        return claim.lack(_advise(table, line))
    total = (known[f"{line}_last"] - known[f"{line}_first"]).to_numpy(float)
    early = (known[f"{line}_early"] - known[f"{line}_first"]).to_numpy(float)
    steady = float((EARLY / known["last"]).mean())
    logarithmic = float((np.log(EARLY + 1) / np.log(known["last"] + 1)).mean())
    gain, share = small_samples.mean_interval(total), small_samples.ratio_interval(early, total)
    why = f"total {gain.write()}"
    against = finding.Against(steady, logarithmic)
    if not gain.low > 0:
        unknown = finding.UNKNOWN, f"{why}, which does not prove a gain"
        return claim.conclude(small_samples.NOTHING, len(known), unknown, against)
    verdict = finding.require_replicates(finding.judge_above(share, steady), len(known))
    why += f"; expected: {steady:.0%} of a steady gain, {logarithmic:.0%} of random designs"
    difference = small_samples.Interval(*(bound - logarithmic for bound in astuple(share)))
    judged = finding.require_beyond_random(verdict, why, share.low > logarithmic, difference)
    return claim.conclude(share, len(known), judged, against)


def _advise(table: pd.DataFrame, line: str) -> str:
    needed = f"two mirrored runs of {EARLY + 2} generations or more, {line}"
    if table.empty:
        return needed
    longest = int(table["last"].max()) + 1
    if longest < EARLY + 2:
        fix = f"evoros resume FOLDER optimizer.generations={EARLY + 10}"
        return f"{needed}; the longest has {longest} ({fix})"
    return f"{needed} (optimizer.validation_trials)" if line == "validated" else needed


def judge_approach(table: pd.DataFrame) -> finding.Finding:
    """Test how close the population mean comes to the best; ``table`` is from ``read_gains``."""
    if len(table) < 2:
        return APPROACH.lack("two mirrored runs")
    ratio = small_samples.ratio_interval(
        table.gap_last.to_numpy(float), table.gap_first.to_numpy(float)
    )
    verdict = finding.require_replicates(finding.judge_above(-ratio, -0.5), len(table))
    first, last = table.gap_first.mean(), table.gap_last.mean()
    why = f"the mean is {first:.1f} below the best at first and {last:.1f} at the end"
    return APPROACH.conclude(ratio, len(table), (verdict, why), finding.Against(0.5))


def judge_heading_swing(table: pd.DataFrame, built_in: bool = False) -> finding.Finding:
    """Test the median of the runs' median swings; ``table`` has ``run`` and ``swing_deg``."""
    if table.empty:
        return SWING.lack("mirrored runs in which the heading swings for two periods in a row")
    medians = table.groupby("run").swing_deg.median()
    interval = small_samples.median_interval(medians.to_numpy(float))
    within = finding.judge_within(interval, 0.75 * SWING_DEG, 1.25 * SWING_DEG)
    why = f"{len(table)} swings; 95% of them up to {table.swing_deg.quantile(0.95):.0f} deg"
    verdict = finding.require_replicates(within, len(medians))
    if built_in:
        verdict = finding.BUILT_IN
        why = f"the controller weaves by design (navigation=serpentine); {why}"
    return SWING.conclude(interval, len(medians), (verdict, why), finding.Against(SWING_DEG))


def judge_completion(
    table: pd.DataFrame, drawn: pd.DataFrame | None = None
) -> Iterator[finding.Finding]:
    """Test the completion rate of champions with a failed sensor, by kind of failure and source.

    The tables are from ``list_missions`` and ``list_random_missions``; champions are resampled.
    """
    for kind in (RANDOM, SPATIAL):
        missions = table[table.kind == kind] if len(table) else table
        if missions.empty or not missions.failed.any():
            claim = finding.Claim(COMPLETED, f"completed, {kind} failure")
            yield claim.lack(f"validated runs with failure={kind}")
            continue
        for source, rows in missions.groupby("source"):
            claim = finding.Claim(COMPLETED, f"completed, {kind} failure, {source}")
            completed = rows[rows.failed].groupby("run").completed
            done, total = (np.asarray(c, float) for c in (completed.sum(), completed.count()))
            share = small_samples.ratio_interval(done, total)
            unharmed = int((~rows.failed).sum())
            why = f"{done.sum():.0f} of {total.sum():.0f} missions with a failed sensor"
            why += f"; {unharmed} ended before the sensor failed" if unharmed else ""
            rate = _random_rate(drawn, kind)
            why += "" if np.isnan(rate) else f"; random designs: {rate:.0%}"
            verdict = finding.require_replicates(finding.judge_above(share, 0.5), len(total))
            judged = finding.require_beyond_random(verdict, why, not rate >= share.low)
            yield claim.conclude(share, len(total), judged, finding.Against(0.5, rate))


def _random_rate(drawn: pd.DataFrame | None, kind: str) -> float:
    if drawn is None or drawn.empty:
        return np.nan
    rows = drawn[(drawn.kind == kind) & drawn.failed]
    return float(rows.completed.mean()) if len(rows) else np.nan
