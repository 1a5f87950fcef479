"""Features of designs, one row each, and comparisons of champions with random designs."""

from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd

from evoros.storage.figure_context import Ring

from ..statistics.small_samples import (
    Interval,
    fisher,
    holm,
    mean_interval,
    median_interval,
    share_interval,
)
from ..statistics.two_samples import brunner_munzel
from .clusters import Clusters, compare_with_samples, find_clusters
from .coverage import (
    DESIGN,
    HEADINGS_DEG,
    NEAR_DEG,
    NEAR_M,
    compute_directions,
    compute_profiles,
    measure_nearness,
    paper_rings,
    share_ahead,
)

FRONT, SIDE, NEITHER = "front array", "side mounts", "no sensors"
ALL = "all"
"""Value of the column ``treatment`` for the champions of all treatments together."""
_ORDER = ("treatment", "measure", "at", "value", "low", "high", "n", "random", "n_random", "p")
Row = dict[str, object]


def describe_designs(
    champions: pd.DataFrame,
    initial: pd.DataFrame,
    rings: Sequence[Ring] = (),
    near_m: float = NEAR_M,
    near_deg: float = NEAR_DEG,
) -> pd.DataFrame:
    """Compute the features of champions and random designs from their sensors: one row per design.

    A design is a front array if at least half of its total field of view lies within 30 deg of
    straight ahead.
    Clustered champions take the class of their cluster's mean. Random designs are dropped if no
    champion of their treatment has the same number of sensors.
    """
    best = _describe(champions, rings, near_m, near_deg).assign(random=False)
    clusters = find_clusters(compute_directions(best[HEADINGS_DEG]))
    if clusters.real:
        best["strategy"] = best.groupby(clusters.labels).ahead.transform("mean").map(_classify)
    drawn = _describe(initial, rings, near_m, near_deg).assign(random=True)
    numbers = set(zip(best.treatment, best.sensors, strict=True))
    comparable = [pair in numbers for pair in zip(drawn.treatment, drawn.sensors, strict=True)]
    both = pd.concat([best, drawn[comparable]], ignore_index=True)
    first = [*DESIGN, "random"]
    return both[[*first, *(name for name in both if name not in first)]]


def _describe(
    sensors: pd.DataFrame, rings: Sequence[Ring], near_m: float, near_deg: float
) -> pd.DataFrame:
    # A champion without sensors has no design number, but counts as a design.
    sensors = sensors.assign(design=sensors.design.fillna(-1).astype(int))
    share = share_ahead(sensors)
    nearness = measure_nearness(sensors, rings, near_m, near_deg)
    table = pd.concat([share, share.map(_classify).rename("strategy"), nearness], axis=1)
    return pd.concat([table, compute_profiles(sensors)], axis=1).reset_index()


def _classify(share: float) -> str:
    """Name the strategy for a share of the field of view ahead; NaN: no sensors."""
    if np.isnan(share):
        return NEITHER
    return FRONT if share >= 0.5 else SIDE


def compare_with_random(table: pd.DataFrame, rings: Sequence[Ring] = ()) -> pd.DataFrame:
    """Compare champions with random designs: one row per treatment and feature.

    ``table`` comes from ``describe_designs``; ``docs/analysis.md`` describes the columns. Clusters
    are tested against clouds without clusters and against samples of random designs.
    """
    radii = [ring.radius_m for ring in tuple(rings) or paper_rings()]
    rows: list[Row] = []
    for treatment in dict.fromkeys(table.treatment):
        designs = table[table.treatment == treatment]
        best, drawn = designs[~designs.random], designs[designs.random]
        rows += [{"treatment": treatment, **row} for row in _compare(best, drawn, radii)]
        rows += [{"treatment": treatment, **row} for row in _structure(best, drawn)]
    if table.treatment.nunique() > 1:
        structure = _structure(table[~table.random], table[table.random])
        rows += [{"treatment": ALL, **row} for row in structure]
    frame = pd.DataFrame(rows, columns=list(_ORDER))
    return frame.assign(p_holm=_adjust(frame))


def _compare(best: pd.DataFrame, drawn: pd.DataFrame, radii: Sequence[float]) -> Iterator[Row]:
    for heading in HEADINGS_DEG:
        interval = mean_interval(best[heading].to_numpy(float))
        row = _row("coverage", interval, best, drawn, at=heading)
        yield {**row, "random": drawn[heading].mean()}
    seeing, drawn_seeing = best.dropna(subset="ahead"), drawn.dropna(subset="ahead")
    row = _row("ahead", median_interval(seeing.ahead.to_numpy(float)), seeing, drawn_seeing)
    p = _p(seeing.ahead, drawn_seeing.ahead)
    yield {**row, "random": drawn_seeing.ahead.median(), "p": p}
    for name in (FRONT, SIDE):
        yield _share(name, seeing.strategy == name, drawn_seeing.strategy == name)
    yield _share("redundant", best.redundant, drawn.redundant)
    for radius in radii:
        yield _share("pair within", best.closest_m <= radius, drawn.closest_m <= radius, radius)
    row = _row("lost", mean_interval(best.lost.to_numpy(float)), best, drawn)
    yield {**row, "random": drawn.lost.mean(), "p": _p(best.lost, drawn.lost)}


def _structure(best: pd.DataFrame, drawn: pd.DataFrame) -> Iterator[Row]:
    clusters = cluster_designs(best)
    score = Interval(clusters.silhouette)
    yield {**_row("clusters", Interval(clusters.count), best, drawn), "p": clusters.p}
    yield {**_row("silhouette", score, best, drawn), "p": clusters.p}
    pool = compute_directions(drawn[HEADINGS_DEG].drop_duplicates())
    p = compare_with_samples(clusters.silhouette, len(best), pool)
    yield {**_row("silhouette, against random designs", score, best, drawn), "p": p}


def cluster_designs(designs: pd.DataFrame) -> Clusters:
    """Cluster the designs of a table of ``describe_designs`` by the headings that they cover."""
    return find_clusters(compute_directions(designs[HEADINGS_DEG]))


def _share(name: str, best: "pd.Series[bool]", drawn: "pd.Series[bool]", at: float = np.nan) -> Row:
    count, others = int(best.sum()), int(drawn.sum())
    row = _row(name, share_interval(count, len(best)), best, drawn, at)
    p = fisher(count, len(best), others, len(drawn))
    return {**row, "random": drawn.mean() if len(drawn) else np.nan, "p": p}


def _row(name: str, interval: Interval, best: object, drawn: object, at: float = np.nan) -> Row:
    return {
        "measure": name,
        "at": at,
        "value": interval.value,
        "low": interval.low,
        "high": interval.high,
        "n": len(best),  # type: ignore[arg-type]
        "n_random": len(drawn),  # type: ignore[arg-type]
    }


def _p(best: "pd.Series[float]", drawn: "pd.Series[float]") -> float:
    known = len(best) and len(drawn)
    return brunner_munzel(best.to_numpy(float), drawn.to_numpy(float)) if known else np.nan


def _adjust(frame: pd.DataFrame) -> "pd.Series[float]":
    """Adjust the p-values of each measure over the treatments, using Holm's method."""
    single = frame[frame.p.notna() & (frame.treatment != ALL)]
    adjusted = frame.p.where(frame.treatment == ALL).copy()
    for rows in single.groupby(["measure", "at"], dropna=False).groups.values():
        adjusted[rows] = holm(frame.p[rows].to_list())
    return adjusted
