"""The paper's findings about designs: two configurations, redundancy, clusters, convergence."""

import numpy as np
import pandas as pd

from .clusters import LEAST
from .coverage import HEADINGS_DEG
from .design_features import FRONT, SIDE, structure
from .finding import NOT_SUPPORTED, NUMBER, SUPPORTED, UNKNOWN, Claim, Finding, above, enough
from .spread import apart, mean_apart, relative_difference
from .statistics import LEVEL, Interval, a12, fisher, mann_whitney, median_interval, share_interval

REDUNDANT = 0.6
"""The paper: six of ten."""
NONE, RANDOM, SPATIAL = "none", "random", "spatial"
"""Kinds of failure, as their modules are named."""

CONFIGURATIONS = Claim(
    "Two main configurations emerge: sensors across the front, and at the sides",
    "silhouette of the best clustering by where champions look",
    NUMBER,
)
REDUNDANCY = Claim(
    "Random failure: in six of ten, two sensors nearly share place and direction",
    "champions with a redundant pair",
)
DAMAGE = "Spatial failure: there are clusters of sensors within the radius of damage"
BETWEEN = Claim(
    "Placed freely, without symmetry, designs converge little",
    "spread of champions over that of random designs: free less mirrored",
    NUMBER,
)
WITHIN = Claim(
    "Placed freely, without symmetry, designs converge little",
    "diversity of the last population over the first: free, median",
    NUMBER,
)


def configurations(table: pd.DataFrame) -> Finding:
    """Whether mirrored champions fall into two clusters, of which one looks ahead.

    ``table`` has the columns of ``traits`` and ``kind``, the failure. Supported: clouds without
    clusters seldom (p < 0.05) look like this, there are two clusters, a front array and side
    mounts. Not supported: there are other clusters, or half of these clouds look more clustered.
    """
    own = table[~table.random]
    if len(own) < LEAST:
        return CONFIGURATIONS.missing(f"{LEAST} champions of mirrored designs, has {len(own)}")
    found = structure(own)
    front, side = (int((own.strategy == name).sum()) for name in (FRONT, SIDE))
    pair = found.count == 2 and own.groupby(found.labels).strategy.first().nunique() == 2
    if found.real:
        verdict = SUPPORTED if pair else NOT_SUPPORTED
    else:
        verdict = NOT_SUPPORTED if found.p >= 0.5 else UNKNOWN
    clusters = "1 cluster" if found.count == 1 else f"{found.count} clusters"
    why = f"{clusters}; {front} front arrays and {side} side mounts"
    silhouette = Interval(found.silhouette, np.nan, np.nan)
    return CONFIGURATIONS.found(silhouette, len(own), verdict, why, found.expected, found.p)


def redundancy(table: pd.DataFrame) -> Finding:
    """How many champions under random failure have a redundant pair.

    Supported: more than random designs (p < 0.05), and six of ten within or below the interval. Not
    supported: the interval lies below six of ten, or fewer have one than random designs (p < 0.05).
    """
    mine = table[table.kind == RANDOM]
    own, drawn = mine[~mine.random], mine[mine.random]
    if own.empty:
        return REDUNDANCY.missing("runs with failure=random")
    count, others = int(own.redundant.sum()), int(drawn.redundant.sum())
    found, rate = share_interval(count, len(own)), float(drawn.redundant.mean())
    p = fisher(count, len(own), others, len(drawn))
    verdict = UNKNOWN
    if found.high < REDUNDANT or (p < LEVEL and found.value < rate):
        verdict = NOT_SUPPORTED
    elif p < LEVEL:
        verdict = SUPPORTED
    calm = table[(table.kind == NONE) & ~table.random]
    also = f"; {calm.redundant.sum()} of {len(calm)} without failure" if len(calm) else ""
    why = f"{count} of {len(own)}, {rate:.0%} of random designs{also}"
    return REDUNDANCY.found(found, len(own), verdict, why, rate, p)


def damage(table: pd.DataFrame, radius_m: float) -> Finding:
    """How many champions under spatial failure have two sensors within a radius.

    Supported: most (the interval lies above a half), and not fewer than random designs (p < 0.05).
    Not supported: the interval lies below a half, or fewer than random designs.
    """
    claim = Claim(DAMAGE, f"champions with two sensors within {1000 * radius_m:.0f} mm")
    mine = table[table.kind == SPATIAL]
    own, drawn = mine[~mine.random], mine[mine.random]
    if own.empty:
        return claim.missing("runs with failure=spatial")
    count, others = int((own.closest_m <= radius_m).sum()), int((drawn.closest_m <= radius_m).sum())
    found, rate = share_interval(count, len(own)), others / len(drawn) if len(drawn) else np.nan
    p = fisher(count, len(own), others, len(drawn))
    fewer = p < LEVEL and found.value < rate
    calm = table[(table.kind == NONE) & ~table.random]
    also = f"; {(calm.closest_m <= radius_m).sum()} of {len(calm)} without failure"
    why = f"{count} of {len(own)}, {rate:.0%} of random designs{also if len(calm) else ''}"
    verdict = NOT_SUPPORTED if fewer else above(found, 0.5)
    return claim.found(found, len(own), verdict, why, rate, p)


def spread_between(mirrored: pd.DataFrame, free: pd.DataFrame) -> Finding:
    """Whether champions of runs without symmetry differ more from each other.

    Both relative to the random designs that the runs began with. Supported: the interval of the
    difference lies above 0. Not supported: below.
    """
    ratios = []
    for table in (free, mirrored):
        own, drawn = (apart(table.loc[table.random == flag, HEADINGS_DEG]) for flag in (0, 1))
        if len(own) < 2 or not mean_apart(drawn) > 0:
            return BETWEEN.missing(_wanted(mirrored, free))
        ratios.append((own, mean_apart(drawn)))
    found = relative_difference(*ratios[0], *ratios[1])
    each = [mean_apart(own) / drawn for own, drawn in ratios]
    why = f"free {each[0]:.2f}, mirrored {each[1]:.2f} (1: as far apart as random designs)"
    counts = [len(own) for own, _ in ratios]
    return BETWEEN.found(found, counts[0], enough(above(found, 0.0), *counts), why, 0.0)


def spread_within(mirrored: pd.DataFrame, free: pd.DataFrame) -> Finding:
    """Whether populations without symmetry stay more diverse: ``diversity``, a row a run.

    Supported: more so (Mann-Whitney p < 0.05). Not supported: less so.
    """
    kept = [(each["last"] / each["first"]).to_numpy(float) for each in (free, mirrored)]
    if min(map(len, kept)) < 2:
        return WITHIN.missing(_wanted(mirrored, free))
    found, other = median_interval(kept[0]), float(np.median(kept[1]))
    p, effect = mann_whitney(*kept), a12(*kept)
    verdict = UNKNOWN if p >= LEVEL else SUPPORTED if effect > 0.5 else NOT_SUPPORTED
    why = f"mirrored {other:.2f}; A12 {effect:.2f}"
    return WITHIN.found(found, len(kept[0]), verdict, why, other, p)


def _wanted(mirrored: pd.DataFrame, free: pd.DataFrame) -> str:
    if free.empty:
        return "runs with experiment=free_placement"
    if mirrored.empty:
        return "mirrored runs with the same failure"
    return "two runs of each"
