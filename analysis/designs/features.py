"""Features of designs, one row per design, and comparisons of champions and random designs."""

from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd

from evoros.base.arrays import Array
from evoros.failure.spatial import SpatialFailure
from evoros.sensor.protocol import RAY_DEG
from evoros.storage.figure_context import Ring

from ..statistics import small_samples
from ..statistics.two_samples import brunner_munzel
from .clusters import Clusters, compare_with_samples, find_clusters

STEP_DEG = 5
HEADINGS_DEG = np.arange(-180.0, 180.0, STEP_DEG)  # 0 ahead, left positive; -180 is 180
AHEAD_DEG = 30.0  # maximum angle from straight ahead that counts as ahead
QUANTILES = 36
DESIGN = ["run", "treatment", "seed", "design"]  # columns that identify a design in a sensor table
NEAR_M, NEAR_DEG = 0.05, 15.0  # maximum distance and angle (half a beam) of redundant sensors
_PLACE = ["x_m", "y_m", "z_m", "yaw_deg", "pitch_deg", "pair"]


def compute_profiles(sensors: pd.DataFrame) -> pd.DataFrame:
    """Count the sensors of each design that cover each heading, averaged over ``STEP_DEG``."""
    frame = pd.DataFrame(_overlap(sensors, HEADINGS_DEG, STEP_DEG / 2) / STEP_DEG)
    frame.columns = pd.Index(HEADINGS_DEG)
    return frame.groupby([sensors[name].to_numpy() for name in DESIGN]).sum().rename_axis(DESIGN)


def share_ahead(sensors: pd.DataFrame, within_deg: float = AHEAD_DEG) -> "pd.Series[float]":
    """Return the fraction of each design's field of view within ``within_deg`` of 0 deg."""
    placed = sensors.yaw_deg.notna().to_numpy()
    opening = np.where(placed, _openings(sensors), 0.0)
    seen = _overlap(sensors, np.zeros(1), within_deg)[:, 0]
    keys = [sensors[name].to_numpy() for name in DESIGN]
    frame = pd.DataFrame({"seen": seen, "opening": opening}).groupby(keys).sum()
    total = frame.opening.where(frame.opening > 0)
    return (frame.seen / total).rename_axis(DESIGN).rename("ahead")


def _overlap(sensors: pd.DataFrame, headings: Array, around: float) -> Array:
    """Return the angle (n, headings) [deg] that each sensor covers within ``around`` a heading."""
    yaw, half = sensors.yaw_deg.to_numpy(float)[:, None], _openings(sensors)[:, None] / 2
    overlap = np.zeros((len(sensors), len(headings)))
    for turn in (-360.0, 0.0, 360.0):
        low = np.maximum(yaw - half, turn + headings - around)
        high = np.minimum(yaw + half, turn + headings + around)
        overlap += np.nan_to_num(np.maximum(high - low, 0.0))  # NaN: no sensor
    return overlap


def _openings(sensors: pd.DataFrame) -> Array:
    return np.asarray(np.maximum(sensors.fov_deg.to_numpy(float), RAY_DEG))  # NaN: no sensor


def compute_directions(profiles: pd.DataFrame) -> Array:
    """Return quantiles (n, ``QUANTILES``) of the angles [deg] of covered headings from 0 deg.

    Left and right are equivalent; a design without sensors has 180 everywhere. If all sensors
    rotate together, these points move along a line, while profiles move along a curve.
    """
    values = profiles.to_numpy(float)
    mirrored = np.roll(values[:, ::-1], 1, axis=1)  # -180 stays in place, 5 becomes -5
    zero = len(HEADINGS_DEG) // 2
    # columns: 0, 5, ..., 180 deg from straight ahead
    both_sides = np.hstack([values + mirrored, 2 * values[:, :1]])[:, zero:]
    edges = np.clip(np.arange(both_sides.shape[1] + 1) - 0.5, 0, zero) * STEP_DEG
    seen = np.hstack([np.zeros((len(values), 1)), np.cumsum(both_sides * np.diff(edges), axis=1)])
    levels = (np.arange(QUANTILES) + 0.5) / QUANTILES
    rows = [
        np.interp(levels * row[-1], row, edges) if row[-1] > 0 else np.full(QUANTILES, 180.0)
        for row in seen
    ]
    return np.array(rows).reshape(-1, QUANTILES)


def normalize_profiles(profiles: pd.DataFrame) -> Array:
    """Return profiles divided by their sums (n, 73); the last column is 1 for an empty profile."""
    values = profiles.to_numpy(float)
    total = values.sum(axis=1, keepdims=True)
    blind = total == 0
    return np.hstack([values / np.where(blind, 1.0, total), blind.astype(float)])


def paper_rings() -> tuple[Ring, ...]:
    """Return the damage rings of the treatment ``spatial`` in the paper."""
    failure = SpatialFailure()
    return tuple(map(Ring, failure.radii_m, failure.probabilities))


def measure_nearness(
    sensors: pd.DataFrame,
    rings: Sequence[Ring] = (),
    near_m: float = NEAR_M,
    near_deg: float = NEAR_DEG,
) -> pd.DataFrame:
    """Measure the distances between the sensors of each design: one row per design.

    Two sensors are ``redundant`` if they are not twins and lie within ``near_m``, and within
    ``near_deg`` in yaw and pitch. ``closest_m`` is the minimum distance between two sensors.
    ``lost`` is the expected number of sensors that fail if damage with ``rings`` (default: the
    paper's) hits one sensor.
    """
    rings = tuple(rings) or paper_rings()
    rows = {key: _measure(places, rings, near_m, near_deg) for key, places in _designs(sensors)}
    index = pd.MultiIndex.from_tuples(rows, names=DESIGN)
    columns = ["sensors", "redundant", "closest_m", "lost"]
    return pd.DataFrame(list(rows.values()), index, columns).sort_index()


def _designs(sensors: pd.DataFrame) -> Iterator[tuple[tuple[object, ...], Array]]:
    """Yield the key of each design, and the columns ``_PLACE`` (n, 6) of its sensors."""
    values = sensors[_PLACE].to_numpy(float)
    for key, places in sensors.groupby(DESIGN).indices.items():
        rows = values[places]
        yield key, rows[~np.isnan(rows[:, 0])]  # type: ignore[misc]


def _measure(
    places: Array, rings: Sequence[Ring], near_m: float, near_deg: float
) -> tuple[object, ...]:
    n = len(places)
    distances = np.linalg.norm(places[:, None, :3] - places[None, :, :3], axis=2)
    turns = np.abs((places[:, None, 3:5] - places[None, :, 3:5] + 180.0) % 360.0 - 180.0)
    others = places[:, None, 5] != places[None, :, 5]
    same = others & (distances <= near_m + 1e-9) & (turns.max(axis=2) <= near_deg + 1e-9)
    closest = distances[~np.eye(n, dtype=bool)].min() if n > 1 else np.inf
    radii = np.array([ring.radius_m for ring in rings])
    probabilities = np.array([*(ring.probability for ring in rings), 0.0])
    chances = probabilities[np.searchsorted(radii, distances)]
    return n, bool(same.any()), float(closest), float(chances.sum() / n) if n else 0.0


FRONT, SIDE, NEITHER = "front array", "side mounts", "no sensors"
ALL = "all"  # value of ``treatment`` for the champions of all treatments together
_ORDER = ("treatment", "measure", "at", "value", "low", "high", "n", "random", "n_random", "p")
Row = dict[str, object]


def describe_designs(
    champions: pd.DataFrame,
    initial: pd.DataFrame,
    rings: Sequence[Ring] = (),
    near_m: float = NEAR_M,
    near_deg: float = NEAR_DEG,
) -> pd.DataFrame:
    """Compute features of champions and comparable random designs, one row per design."""
    best = _describe(champions, rings, near_m, near_deg).assign(random=False)
    clusters = find_clusters(compute_directions(best[HEADINGS_DEG]))
    if clusters.real:  # the mean of a cluster classifies each champion in it
        best["strategy"] = best.groupby(clusters.labels).ahead.transform("mean").map(_classify)
    if len(initial):  # comparable designs have as many sensors as a champion of the same treatment
        drawn = _describe(initial, rings, near_m, near_deg).assign(random=True)
        numbers = set(zip(best.treatment, best.sensors, strict=True))
        comparable = [pair in numbers for pair in zip(drawn.treatment, drawn.sensors, strict=True)]
        best = pd.concat([best, drawn[comparable]], ignore_index=True)
    first = [*DESIGN, "random"]
    return best[[*first, *(name for name in best if name not in first)]]


def _describe(
    sensors: pd.DataFrame, rings: Sequence[Ring], near_m: float, near_deg: float
) -> pd.DataFrame:
    # A champion without sensors has no design number, but is still a design.
    sensors = sensors.assign(design=sensors.design.fillna(-1).astype(int))
    share = share_ahead(sensors)
    nearness = measure_nearness(sensors, rings, near_m, near_deg)
    table = pd.concat([share, share.map(_classify).rename("strategy"), nearness], axis=1)
    return pd.concat([table, compute_profiles(sensors)], axis=1).reset_index()


def _classify(share: float) -> str:
    if np.isnan(share):
        return NEITHER
    return FRONT if share >= 0.5 else SIDE


def compare_with_random(table: pd.DataFrame, rings: Sequence[Ring] = ()) -> pd.DataFrame:
    """Compare champions with random designs: one row per treatment and feature."""
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
        interval = small_samples.mean_interval(best[heading].to_numpy(float))
        row = _row("coverage", interval, best, drawn, at=heading)
        yield {**row, "random": drawn[heading].mean()}
    seeing, drawn_seeing = best.dropna(subset="ahead"), drawn.dropna(subset="ahead")
    row = _row(
        "ahead", small_samples.median_interval(seeing.ahead.to_numpy(float)), seeing, drawn_seeing
    )
    p = _p(seeing.ahead, drawn_seeing.ahead)
    yield {**row, "random": drawn_seeing.ahead.median(), "p": p}
    for name in (FRONT, SIDE):
        yield _share(name, seeing.strategy == name, drawn_seeing.strategy == name)
    yield _share("redundant", best.redundant, drawn.redundant)
    for radius in radii:
        yield _share("pair within", best.closest_m <= radius, drawn.closest_m <= radius, radius)
    row = _row("lost", small_samples.mean_interval(best.lost.to_numpy(float)), best, drawn)
    yield {**row, "random": drawn.lost.mean(), "p": _p(best.lost, drawn.lost)}


def _structure(best: pd.DataFrame, drawn: pd.DataFrame) -> Iterator[Row]:
    clusters = cluster_designs(best)
    score = small_samples.Interval(clusters.silhouette)
    yield {**_row("clusters", small_samples.Interval(clusters.count), best, drawn), "p": clusters.p}
    yield {**_row("silhouette", score, best, drawn), "p": clusters.p}
    pool = compute_directions(drawn[HEADINGS_DEG].drop_duplicates())
    p = compare_with_samples(clusters.silhouette, len(best), pool)
    yield {**_row("silhouette, against random designs", score, best, drawn), "p": p}


def cluster_designs(designs: pd.DataFrame) -> Clusters:
    """Cluster designs from ``describe_designs`` by the headings that their sensors cover."""
    return find_clusters(compute_directions(designs[HEADINGS_DEG]))


def _share(name: str, best: "pd.Series[bool]", drawn: "pd.Series[bool]", at: float = np.nan) -> Row:
    count, others = int(best.sum()), int(drawn.sum())
    row = _row(name, small_samples.share_interval(count, len(best)), best, drawn, at)
    p = small_samples.fisher(count, len(best), others, len(drawn))
    return {**row, "random": drawn.mean() if len(drawn) else np.nan, "p": p}


def _row(
    name: str, interval: small_samples.Interval, best: object, drawn: object, at: float = np.nan
) -> Row:
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
    single = frame[frame.p.notna() & (frame.treatment != ALL)]
    adjusted = frame.p.where(frame.treatment == ALL).copy()
    for rows in single.groupby(["measure", "at"], dropna=False).groups.values():
        adjusted[rows] = small_samples.holm(frame.p[rows].to_list())
    return adjusted
