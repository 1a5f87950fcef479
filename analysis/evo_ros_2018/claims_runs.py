"""The paper's claims about runs and missions: gains, swings of the heading, completed missions."""

from collections.abc import Iterator
from dataclasses import astuple

import numpy as np
import pandas as pd

from ..statistics.finding import (
    BUILT_IN,
    DEGREES,
    UNKNOWN,
    Against,
    Claim,
    Finding,
    judge_above,
    judge_within,
    require_beyond_random,
    require_replicates,
)
from ..statistics.small_samples import (
    NOTHING,
    Interval,
    mean_interval,
    median_interval,
    ratio_interval,
)
from ..tables.generations import trace_fitness
from ..tables.records import Record
from .claims_designs import RANDOM, SPATIAL

EARLY = 15
"""Generations in which the paper found most gains."""
SWING_DEG = 60.0
EARLY_TEXT = f"Most increases in fitness take place during the first {EARLY} generations"
GAIN = {
    name: Claim(EARLY_TEXT, f"share of the gain reached by generation {EARLY}, {name}")
    for name in ("recorded", "validated")
}
APPROACH = Claim(
    "The average fitness approaches that of the fittest",
    "distance of mean and best, last generation over first",
)
SWING = Claim(
    "Driving to a waypoint, the heading swings in an arc of up to 60 deg",
    "swing of the heading about the course, median",
    DEGREES,
)
COMPLETED = "Even in the presence of sensor failure, missions are completed"


def read_gains(record: Record) -> pd.DataFrame:
    """Read ``recorded``, ``validated`` and ``gap`` (best less mean) of a run, in a row.

    The columns end in ``_first``, ``_early`` and ``_last`` by generation, except ``last`` itself.
    """
    traced = trace_fitness(record.run.generations)
    first, last = traced.index[0], traced.index[-1]
    row: dict[str, object] = {"last": int(last)}
    for name, generation in {"first": first, "early": min(EARLY, last), "last": last}.items():
        for line in GAIN:
            row[f"{line}_{name}"] = traced.loc[generation, line]
        row[f"gap_{name}"] = traced.loc[generation, "recorded"] - traced.loc[generation, "mean"]
    return pd.DataFrame([row])


def judge_gain(table: pd.DataFrame, line: str) -> Finding:
    """Judge the share of the total gain that was reached early; ``table``: ``read_gains``.

    Supported: the interval is above the share that random designs would have reached, whose
    best grows as the logarithm of their number. Not supported: below that of a steady gain.
    If the interval of the total gain contains 0, there is no verdict.
    """
    claim = GAIN[line]
    names = [f"{line}_{name}" for name in ("first", "early", "last")]
    # Without runs the table has no columns.
    known = table[table["last"] > EARLY].dropna(subset=names) if len(table) else table
    if len(known) < 2:
        return claim.lack(_advise(table, line))
    total = (known[f"{line}_last"] - known[f"{line}_first"]).to_numpy(float)
    early = (known[f"{line}_early"] - known[f"{line}_first"]).to_numpy(float)
    steady = float((EARLY / known["last"]).mean())
    logarithmic = float((np.log(EARLY + 1) / np.log(known["last"] + 1)).mean())
    gain, share = mean_interval(total), ratio_interval(early, total)
    why = f"total {gain.write()}"
    against = Against(steady, logarithmic)
    if not gain.low > 0:
        return claim.conclude(NOTHING, len(known), (UNKNOWN, f"{why}: no gain for sure"), against)
    verdict = require_replicates(judge_above(share, steady), len(known))
    why += f"; a steady gain: {steady:.0%}, that of random designs: {logarithmic:.0%}"
    difference = Interval(*(bound - logarithmic for bound in astuple(share)))
    judged = require_beyond_random(verdict, why, share.low > logarithmic, difference)
    return claim.conclude(share, len(known), judged, against)


def _advise(table: pd.DataFrame, line: str) -> str:
    """Name the runs that a judgement of early gains needs, and the longest run."""
    needed = f"two mirrored runs of {EARLY + 2} generations or more, {line}"
    if table.empty:
        return needed
    longest = int(table["last"].max()) + 1
    if longest < EARLY + 2:
        fix = f"evoros resume FOLDER optimizer.generations={EARLY + 10}"
        return f"{needed}; the longest has {longest} ({fix})"
    return f"{needed} (optimizer.validation_trials)" if line == "validated" else needed


def judge_approach(table: pd.DataFrame) -> Finding:
    """Judge how near the mean of the pool comes to the best; ``table``: ``read_gains``.

    Supported: the interval of the last distance is below half of the first. Not supported: above.
    """
    if len(table) < 2:
        return APPROACH.lack("two mirrored runs")
    ratio = ratio_interval(table.gap_last.to_numpy(float), table.gap_first.to_numpy(float))
    verdict = require_replicates(judge_above(-ratio, -0.5), len(table))
    first, last = table.gap_first.mean(), table.gap_last.mean()
    why = f"from {first:.1f} to {last:.1f} below the best"
    return APPROACH.conclude(ratio, len(table), (verdict, why), Against(0.5))


def judge_heading_swing(table: pd.DataFrame, built_in: bool = False) -> Finding:
    """Judge how far the heading swings; ``table`` has ``run`` and ``swing_deg``.

    The value is the median over the runs of the median of a run. Supported: the interval is within
    a quarter of 60 deg. Not supported: it is outside. Neither if the controller weaves by itself:
    then the swing is ``built_in``.
    """
    if table.empty:
        return SWING.lack("mirrored runs in which the heading swings for two periods in a row")
    medians = table.groupby("run").swing_deg.median()
    interval = median_interval(medians.to_numpy(float))
    within = judge_within(interval, 0.75 * SWING_DEG, 1.25 * SWING_DEG)
    why = f"{len(table)} swings; 95% of them up to {table.swing_deg.quantile(0.95):.0f} deg"
    verdict = require_replicates(within, len(medians))
    if built_in:
        verdict, why = BUILT_IN, f"the controller weaves by itself (navigation=serpentine); {why}"
    return SWING.conclude(interval, len(medians), (verdict, why), Against(SWING_DEG))


def judge_completion(table: pd.DataFrame, drawn: pd.DataFrame | None = None) -> Iterator[Finding]:
    """Judge how many missions with a failed sensor champions completed, by kind and source.

    The tables are from ``list_missions`` and ``list_random_missions``. Champions are resampled,
    not missions. Supported: the interval is above a half, and above the share of random designs.
    Not supported: it is below a half.
    """
    for kind in (RANDOM, SPATIAL):
        missions = table[table.kind == kind] if len(table) else table
        if missions.empty or not missions.failed.any():
            claim = Claim(COMPLETED, f"completed, {kind} failure")
            yield claim.lack(f"validated runs with failure={kind}")
            continue
        for source, rows in missions.groupby("source"):
            claim = Claim(COMPLETED, f"completed, {kind} failure, {source}")
            completed = rows[rows.failed].groupby("run").completed
            done, total = (np.asarray(c, float) for c in (completed.sum(), completed.count()))
            share = ratio_interval(done, total)
            unharmed = int((~rows.failed).sum())
            why = f"{done.sum():.0f} of {total.sum():.0f} missions with a failed sensor"
            why += f"; {unharmed} ended before" if unharmed else ""
            rate = _random_rate(drawn, kind)
            why += "" if np.isnan(rate) else f"; random designs: {rate:.0%}"
            verdict = require_replicates(judge_above(share, 0.5), len(total))
            judged = require_beyond_random(verdict, why, not rate >= share.low)
            yield claim.conclude(share, len(total), judged, Against(0.5, rate))


def _random_rate(drawn: pd.DataFrame | None, kind: str) -> float:
    """Return the share of missions with a failed sensor that random designs completed."""
    if drawn is None or drawn.empty:
        return np.nan
    rows = drawn[(drawn.kind == kind) & drawn.failed]
    return float(rows.completed.mean()) if len(rows) else np.nan
