"""A robot from above with its sensors and their cones: its nose up, its left on the left."""

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from evoros.base.arrays import Array
from evoros.geometry.footprint import convex_hull
from evoros.storage.figure_context import FigureContext, Part

Window = tuple[float, float, float, float]  # least and greatest x, least and greatest y [m]

MARKERS = "os^DvP"  # of the types of sensors, in their order
CONE = ["x_m", "y_m", "yaw_deg", "fov_deg", "range_m"]
AXES = ("y, left [m]", "x, forward [m]")
_BODY, _WHEEL = "0.88", "0.45"
_EDGE = "0.35"
_CORNERS = 96  # of a full turn


def outline(part: Part) -> Array:
    """(k, 2) [m]: the corners of what a part covers, in the robot's frame."""
    return hull(np.array(part.vertices), part.radius_m)


def hull(vertices: Array, radius_m: float) -> Array:
    """(k, 2) [m]: the corners of all that lies within a radius of a convex polygon (n, 2)."""
    turn = np.linspace(0.0, 2 * math.pi, _CORNERS, endpoint=False)
    rim = radius_m * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    swept: Array = (vertices[:, None] + rim).reshape(-1, 2)
    return convex_hull(swept)


def cones(sensors: pd.DataFrame, reach_m: float = math.inf) -> list[Array]:
    """What each sensor sees from above: (k, 2) [m], itself and then the arc, from the right.

    ``sensors`` has the columns of ``designs.py``. The range is that along the ground, as of the
    beam's lowest rays, which are nearly level; cones are cut at ``reach_m``.
    """
    return [
        fan(x, y, yaw, fov, min(far, reach_m))
        for x, y, yaw, fov, far in sensors[CONE].to_numpy(dtype=np.float64).tolist()
    ]


def fan(x_m: float, y_m: float, yaw_deg: float, opening_deg: float, radius_m: float) -> Array:
    """(k, 2) [m]: a sector's tip and its arc, from the right; ``yaw_deg`` is its middle."""
    count = 2 + math.ceil(opening_deg / 360 * _CORNERS)
    angles = np.radians(yaw_deg + np.linspace(-opening_deg / 2, opening_deg / 2, count))
    arc = radius_m * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    sector: Array = np.array([x_m, y_m]) + np.vstack([[0.0, 0.0], arc])
    return sector


def covered(sensors: pd.DataFrame, x: Array, y: Array, cell_m: float, reach_m: float) -> Array:
    """Whether the cone of any sensor has the places x, y [m] of the robot's frame in it.

    All three arrays have the same shape.

    A cone reaches at least half a cell to either side: one ray alone is seen, too.
    """
    found = np.zeros(x.shape, dtype=bool)
    for sx, sy, yaw, fov, far in sensors[CONE].to_numpy(dtype=np.float64).tolist():
        dx, dy = x - sx, y - sy
        cos, sin = math.cos(math.radians(yaw)), math.sin(math.radians(yaw))
        ahead, aside = cos * dx + sin * dy, np.abs(cos * dy - sin * dx)
        angle = np.degrees(np.arctan2(aside, ahead))
        narrow = (ahead >= 0) & (aside <= cell_m / 2)
        near = np.hypot(dx, dy) <= min(far, reach_m)
        found |= near & ((angle <= fov / 2 + 1e-9) | narrow)
    return found


def window(
    settings: Iterable[FigureContext], sensors: pd.DataFrame, reach_m: float, margin_m: float = 0.03
) -> Window:
    """What must be drawn for the robots and the cones to be whole; as far left as right."""
    outlines = [outline(part) for setting in settings for part in setting.parts]
    points = np.vstack([*outlines, *cones(sensors, reach_m), np.zeros((1, 2))])
    (x_low, _), (x_high, _) = points.min(axis=0), points.max(axis=0)
    y = float(np.abs(points[:, 1]).max()) + margin_m
    return float(x_low) - margin_m, float(x_high) + margin_m, -y, y


def length(setting: FigureContext) -> float:
    """Of the robot, forward [m]."""
    x = np.concatenate([outline(part)[:, 0] for part in setting.parts])
    return float(np.ptp(x))


def aspect(view: Window) -> float:
    """Height of a picture of the window over its width."""
    x_low, x_high, y_low, y_high = view
    return (x_high - x_low) / (y_high - y_low)


def page(points: Array) -> Array:
    """Points (n, 2) of the robot's frame as they are drawn: y across, x up."""
    return points[:, ::-1]


def frame(axes: Axes, view: Window) -> None:
    """Equally scaled axes of the robot's frame: x forward points up, y left to the left."""
    x_low, x_high, y_low, y_high = view
    axes.set(xlim=(y_high, y_low), ylim=(x_low, x_high), aspect="equal")
    axes.tick_params(length=2, pad=2, labelsize=7)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(4))
        axis.set_major_formatter("{x:g}")


def draw_robot(axes: Axes, setting: FigureContext, fill: bool = True, zorder: float = 1.0) -> None:
    """The parts of a robot, each over the lower ones; its wheels are darker and shine through.

    Without ``fill`` only their edges, to be drawn over what covers the robot.
    """
    for part in sorted(setting.parts, key=lambda part: part.top_m):
        axes.fill(
            *page(outline(part)).T,
            fc=(_WHEEL if part.wheel else _BODY) if fill else "none",
            ec=_EDGE,
            lw=0.4,
            alpha=0.85 if fill else 0.6,
            zorder=zorder,
        )


def draw_cones(
    axes: Axes, sensors: pd.DataFrame, colours: Sequence[str], reach_m: float = math.inf
) -> PolyCollection:
    """The cone of each sensor in its colour, cut at ``reach_m``."""
    drawn = PolyCollection(
        [page(cone) for cone in cones(sensors, reach_m)],
        facecolors=list(colours),
        alpha=0.4,
        linewidths=0.0,
        zorder=2.0,
    )
    edges = PolyCollection(
        [page(cone) for cone in cones(sensors, reach_m)],
        facecolors="none",
        edgecolors=list(colours),
        linewidths=0.5,
        zorder=2.1,
    )
    axes.add_collection(drawn, autolim=False)
    axes.add_collection(edges, autolim=False)
    return drawn


def draw_sensors(
    axes: Axes,
    sensors: pd.DataFrame,
    colours: Sequence[str],
    markers: Mapping[str, str],
    size_pt: float = 3.0,
    alpha: float = 1.0,
) -> None:
    """A dot a sensor in its colour; each type has a shape of its own (``markers_of``)."""
    for kind, marker in markers.items():
        chosen = (sensors["type"] == kind).to_numpy()
        places = page(sensors.loc[chosen, ["x_m", "y_m"]].to_numpy(dtype=np.float64))
        axes.scatter(
            places[:, 0],
            places[:, 1],
            s=size_pt**2,
            c=[colour for colour, one in zip(colours, chosen, strict=True) if one],
            marker=marker,
            edgecolors="black",
            linewidths=0.4,
            alpha=alpha,
            zorder=4.0,
        )


def markers_of(sensors: pd.DataFrame) -> dict[str, str]:
    """The shape of the dots of each type of sensor."""
    kinds = sorted(sensors["type"].unique())
    return {kind: MARKERS[i % len(MARKERS)] for i, kind in enumerate(kinds)}


def type_handles(markers: Mapping[str, str]) -> list[Line2D]:
    """Entries of a legend that tells the types of sensors apart; none where there is only one."""
    if len(markers) < 2:
        return []
    return [
        Line2D([], [], ls="none", marker=marker, mfc="none", mec="black", ms=4, label=kind)
        for kind, marker in markers.items()
    ]
