"""The paper's findings about runs and missions: gains, the weaving heading, completed missions."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from ..figures.fitness import lines
from .claims_designs import RANDOM, SPATIAL
from .finding import DEGREES, NOTHING, UNKNOWN, Claim, Finding, above, enough, within
from .statistics import Interval, mean_interval, median_interval, ratio_interval

if TYPE_CHECKING:
    from ..tables.records import Record

EARLY = 15
"""Generations in which the paper saw most gains."""
SWEEP_DEG = 60.0
EARLY_TEXT = f"Most increases in fitness take place during the first {EARLY} generations"
GAIN = {
    name: Claim(EARLY_TEXT, f"share of the gain reached by generation {EARLY}, {name}")
    for name in ("recorded", "validated")
}
APPROACH = Claim(
    "The average fitness approaches that of the fittest",
    "distance of mean and best, last generation over first",
)
SWEEP = Claim(
    "Driving to a waypoint, the heading swings in an arc of up to 60 deg",
    "swing of the heading about the course, median",
    DEGREES,
)
COMPLETED = "Even in the presence of sensor failure, missions are completed"


def gains(record: "Record") -> pd.DataFrame:
    """One row: how fit the best was first, at generation ``EARLY`` and last; the mean's distance.

    Columns: ``last`` generation, and ``recorded`` and ``validated`` with ``_first``, ``_early`` and
    ``_last``; ``gap_first`` and ``gap_last``, best less mean.
    """
    drawn = lines(record.run.generations)
    at = {"first": drawn.index[0], "early": min(EARLY, drawn.index[-1]), "last": drawn.index[-1]}
    row: dict[str, object] = {"last": int(drawn.index[-1])}
    for name, generation in at.items():
        for line in GAIN:
            row[f"{line}_{name}"] = drawn.loc[generation, line]
        row[f"gap_{name}"] = drawn.loc[generation, "recorded"] - drawn.loc[generation, "mean"]
    return pd.DataFrame([row])


def gain(table: pd.DataFrame, line: str) -> Finding:
    """How much of the gain of all runs was reached early; ``table`` has rows of ``gains``.

    Supported: the interval lies above what a steady gain would have reached by then. Not supported:
    below. Where nothing was gained for sure, nothing can be said.
    """
    claim = GAIN[line]
    long = table[table["last"] > EARLY] if len(table) else table
    known = long.dropna(subset=[f"{line}_{at}" for at in ("first", "early", "last")])
    if len(known) < 2:
        return claim.missing(f"two runs of more than {EARLY} generations, {line}")
    total = (known[f"{line}_last"] - known[f"{line}_first"]).to_numpy(float)
    early = (known[f"{line}_early"] - known[f"{line}_first"]).to_numpy(float)
    steady = float((EARLY / known["last"]).mean())
    whole, found = mean_interval(total), ratio_interval(early, total)
    sure = whole.low > 0
    verdict = enough(above(found, steady), len(known)) if sure else UNKNOWN
    why = f"total {whole.value:.2f} [{whole.low:.2f}, {whole.high:.2f}]"
    why += f"; a steady gain: {steady:.0%}" if sure else ": no gain for sure"
    return claim.found(found if sure else NOTHING, len(known), verdict, why, steady)


def approach(table: pd.DataFrame) -> Finding:
    """How near the mean of the pool comes to the best; ``table`` has rows of ``gains``.

    Supported: to less than half of its first distance, with the whole interval. Not supported: to
    more than half.
    """
    if len(table) < 2:
        return APPROACH.missing("two runs")
    found = ratio_interval(table.gap_last.to_numpy(float), table.gap_first.to_numpy(float))
    verdict = enough(above(Interval(-found.value, -found.high, -found.low), -0.5), len(table))
    first, last = table.gap_first.mean(), table.gap_last.mean()
    why = f"from {first:.1f} to {last:.1f} below the best"
    return APPROACH.found(found, len(table), verdict, why, 0.5)


def sweep(table: pd.DataFrame) -> Finding:
    """How far the heading swings; ``table``: ``run``, ``sweep_deg``, a row a turning point.

    The median over the runs of the median of a run. Supported: the whole interval lies within a
    quarter of 60 deg. Not supported: outside.
    """
    if table.empty:
        return SWEEP.missing("champions that weave for two periods on end")
    each = table.groupby("run").sweep_deg.median()
    found = median_interval(each.to_numpy(float))
    verdict = enough(within(found, 0.75 * SWEEP_DEG, 1.25 * SWEEP_DEG), len(each))
    most = table.sweep_deg.quantile(0.95)
    why = f"{len(table)} swings; 95% of them up to {most:.0f} deg"
    return SWEEP.found(found, len(each), verdict, why, SWEEP_DEG)


def completed(table: pd.DataFrame) -> Iterator[Finding]:
    """How many missions with a failed sensor champions completed: for each kind and source.

    ``table`` has a row a mission: ``kind`` of failure; ``source``, where it was flown; ``run``, the
    champion; ``failed``, whether a sensor had failed; ``completed``. Champions are resampled, not
    missions. Supported: most are completed (the interval lies above a half); not supported: fewer.
    """
    for kind in (RANDOM, SPATIAL):
        mine = table[table.kind == kind] if len(table) else table
        if mine.empty or not mine.failed.any():
            yield Claim(COMPLETED, f"completed, {kind} failure").missing(
                f"validated runs with failure={kind}"
            )
            continue
        for source, flown in mine.groupby("source"):
            claim = Claim(COMPLETED, f"completed, {kind} failure, {source}")
            hit = flown[flown.failed].groupby("run").completed
            done, all_hit = (np.asarray(each, float) for each in (hit.sum(), hit.count()))
            found = ratio_interval(done, all_hit)
            early = flown[~flown.failed]
            why = f"{done.sum():.0f} of {all_hit.sum():.0f} missions with a failed sensor"
            why += f"; {len(early)} ended before" if len(early) else ""
            verdict = enough(above(found, 0.5), len(hit))
            yield claim.found(found, len(hit), verdict, why, 0.5)
