"""What designs are like, as numbers: a row a design; and champions against random designs."""

from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd

from evoros.base.arrays import Array
from evoros.storage.figure_context import Ring

from .clusters import Clusters, clusters, p_of_samples
from .coverage import DESIGN, HEADINGS_DEG, ahead, directions, profiles
from .pairs import NEAR_DEG, NEAR_M, nearness, paper_rings
from .statistics import (
    Interval,
    fisher,
    holm,
    mann_whitney,
    mean_interval,
    median_interval,
    share_interval,
)

FRONT, SIDE, NEITHER = "front array", "side mounts", "no sensors"
ALL = "all"
"""In the column ``treatment``: the champions of all treatments together."""


def traits(
    champions: pd.DataFrame,
    initial: pd.DataFrame,
    rings: Sequence[Ring] = (),
    near_m: float = NEAR_M,
    near_deg: float = NEAR_DEG,
) -> pd.DataFrame:
    """A row for each champion and each random design, of their sensors (``designs.py``).

    Columns: those of ``DESIGN``; ``random``, whether it is a random design; ``ahead``, see
    ``coverage.py``; ``strategy``, ``FRONT``, ``SIDE`` or ``NEITHER``; those of
    ``pairs.nearness``; and the sensors that cover each heading, by the heading [deg].

    A design is a front array where at least half of its sensors' openings lies within 30 deg of
    ahead. Champions that fall into clusters are named together, by the mean of their cluster.
    Random designs with a number of sensors that no champion of their treatment has are left out.
    """
    own = _measured(champions, rings, near_m, near_deg).assign(random=False)
    found = clusters(directions(own[HEADINGS_DEG]))
    if found.real:
        own["strategy"] = own.groupby(found.labels).ahead.transform("mean").map(_named)
    drawn = _measured(initial, rings, near_m, near_deg).assign(random=True)
    numbers = set(zip(own.treatment, own.sensors, strict=True))
    alike = [pair in numbers for pair in zip(drawn.treatment, drawn.sensors, strict=True)]
    both = pd.concat([own, drawn[alike]], ignore_index=True)
    first = [*DESIGN, "random"]
    return both[[*first, *(name for name in both if name not in first)]]


def _measured(
    sensors: pd.DataFrame, rings: Sequence[Ring], near_m: float, near_deg: float
) -> pd.DataFrame:
    # Which design it was is not known of a champion without sensors; it is one all the same.
    sensors = sensors.assign(design=sensors.design.fillna(-1).astype(int))
    share = ahead(sensors)
    near = nearness(sensors, rings, near_m, near_deg)
    table = pd.concat([share, share.map(_named).rename("strategy"), near], axis=1)
    return pd.concat([table, profiles(sensors)], axis=1).reset_index()


def _named(share_ahead: float) -> str:
    """NaN is the share of a design that looks nowhere."""
    if np.isnan(share_ahead):
        return NEITHER
    return FRONT if share_ahead >= 0.5 else SIDE


def compared(table: pd.DataFrame, rings: Sequence[Ring] = ()) -> pd.DataFrame:
    """Champions against random designs: a row for each treatment and measure of ``traits``.

    ``at`` is the heading [deg] or the radius [m] of the measure; ``value`` with the ends of its
    95 % interval, of ``n`` champions; ``random`` the same of ``n_random`` random designs; ``p`` of
    their difference; ``p_holm`` adjusted for the treatments of this measure. Of ``clusters`` and
    ``silhouette``, ``random`` is empty and ``p`` that against clouds without clusters; of
    ``silhouette, against random designs``, that against samples of these.
    """
    radii = [ring.radius_m for ring in tuple(rings) or paper_rings()]
    rows = []
    for treatment in dict.fromkeys(table.treatment):
        own = table[table.treatment == treatment]
        each = own[~own.random], own[own.random]
        rows += [{"treatment": treatment, **row} for row in _treatment(*each, radii)]
        rows += [{"treatment": treatment, **row} for row in _structure(*each)]
    if table.treatment.nunique() > 1:
        structure = _structure(table[~table.random], table[table.random])
        rows += [{"treatment": ALL, **row} for row in structure]
    order = ["treatment", "measure", "at", "value", "low", "high", "n", "random", "n_random", "p"]
    frame = pd.DataFrame(rows, columns=order)
    return frame.assign(p_holm=_adjusted(frame))


Row = dict[str, object]


def _treatment(own: pd.DataFrame, drawn: pd.DataFrame, radii: Sequence[float]) -> Iterator[Row]:
    for heading in HEADINGS_DEG:
        row = _row("coverage", mean_interval(_numbers(own[heading])), own, drawn, at=heading)
        yield {**row, "random": drawn[heading].mean()}
    seeing = own.dropna(subset="ahead"), drawn.dropna(subset="ahead")
    row = _row("ahead", median_interval(_numbers(seeing[0].ahead)), *seeing)
    p = _p(seeing[0].ahead, seeing[1].ahead)
    yield {**row, "random": seeing[1].ahead.median(), "p": p}
    for name in (FRONT, SIDE):
        yield _share(name, seeing[0].strategy == name, seeing[1].strategy == name)
    yield _share("redundant", own.redundant, drawn.redundant)
    for radius in radii:
        yield _share("pair within", own.closest_m <= radius, drawn.closest_m <= radius, radius)
    row = _row("lost", mean_interval(_numbers(own.lost)), own, drawn)
    yield {**row, "random": drawn.lost.mean(), "p": _p(own.lost, drawn.lost)}


def _structure(own: pd.DataFrame, drawn: pd.DataFrame) -> Iterator[Row]:
    found = structure(own)
    score = Interval(found.silhouette, np.nan, np.nan)
    yield {**_row("clusters", Interval(found.count, np.nan, np.nan), own, drawn), "p": found.p}
    yield {**_row("silhouette", score, own, drawn), "p": found.p}
    pool = directions(drawn[HEADINGS_DEG].drop_duplicates())
    against = p_of_samples(found.silhouette, len(own), pool)
    yield {**_row("silhouette, against random designs", score, own, drawn), "p": against}


def structure(designs: pd.DataFrame) -> Clusters:
    """Whether the designs of a table of ``traits`` fall into clusters by where they look."""
    return clusters(directions(designs[HEADINGS_DEG]))


def _share(name: str, own: "pd.Series[bool]", drawn: "pd.Series[bool]", at: float = np.nan) -> Row:
    count, others = int(own.sum()), int(drawn.sum())
    row = _row(name, share_interval(count, len(own)), own, drawn, at)
    p = fisher(count, len(own), others, len(drawn))
    return {**row, "random": drawn.mean() if len(drawn) else np.nan, "p": p}


def _row(name: str, found: Interval, own: object, drawn: object, at: float = np.nan) -> Row:
    return {
        "measure": name,
        "at": at,
        "value": found.value,
        "low": found.low,
        "high": found.high,
        "n": len(own),  # type: ignore[arg-type]
        "n_random": len(drawn),  # type: ignore[arg-type]
    }


def _p(own: "pd.Series[float]", drawn: "pd.Series[float]") -> float:
    return mann_whitney(_numbers(own), _numbers(drawn)) if len(own) and len(drawn) else np.nan


def _numbers(column: "pd.Series[float]") -> Array:
    return np.asarray(column, float)


def _adjusted(frame: pd.DataFrame) -> "pd.Series[float]":
    """Holm's, over the treatments of each measure."""
    single = frame[frame.p.notna() & (frame.treatment != ALL)]
    adjusted = frame.p.where(frame.treatment == ALL).copy()
    for rows in single.groupby(["measure", "at"], dropna=False).groups.values():
        adjusted[rows] = holm(frame.p[rows].to_list())
    return adjusted
