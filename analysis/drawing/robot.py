"""A robot from above with its sensors and their cones: its nose up, its left on the left."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from evoros.base.arrays import Array
from evoros.storage.figure_context import FigureContext

from ..measures.cones import Window, outline_part, trace_cones

MARKERS = "os^DvP"  # of the types of sensors, in order
AXES = ("y, left [m]", "x, forward [m]")
_BODY, _WHEEL = "0.88", "0.45"
_EDGE = "0.35"


def aspect_ratio(view: Window) -> float:
    """Return the height of a picture of the window over its width."""
    x_low, x_high, y_low, y_high = view
    return (x_high - x_low) / (y_high - y_low)


def to_page(points: Array) -> Array:
    """Convert points (n, 2) from the robot's frame to the page: y across, x up."""
    return points[:, ::-1]


def frame_axes(axes: Axes, view: Window) -> None:
    """Give axes the window with equal scales: x forward points up, y left to the left."""
    x_low, x_high, y_low, y_high = view
    axes.set(xlim=(y_high, y_low), ylim=(x_low, x_high), aspect="equal")
    axes.tick_params(length=2, pad=2, labelsize="small")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(4))
        axis.set_major_formatter("{x:g}")


def draw_robot(axes: Axes, context: FigureContext, fill: bool = True, zorder: float = 1.0) -> None:
    """Draw the parts of a robot from the lowest up; wheels are darker and shine through.

    Without ``fill`` only the edges are drawn, for use on top of what covers the robot.
    """
    for part in sorted(context.parts, key=lambda part: part.top_m):
        axes.fill(
            *to_page(outline_part(part)).T,
            fc=(_WHEEL if part.wheel else _BODY) if fill else "none",
            ec=_EDGE,
            lw=0.4,
            alpha=0.85 if fill else 0.6,
            zorder=zorder,
        )


def draw_cones(
    axes: Axes, sensors: pd.DataFrame, colours: Sequence[str], reach_m: float = math.inf
) -> PolyCollection:
    """Draw the cone of each sensor in its colour, cut at ``reach_m``; return the filled areas."""
    cones = [to_page(cone) for cone in trace_cones(sensors, reach_m)]
    areas = PolyCollection(cones, facecolors=list(colours), alpha=0.4, linewidths=0.0, zorder=2.0)
    edges = PolyCollection(
        cones, facecolors="none", edgecolors=list(colours), linewidths=0.5, zorder=2.1
    )
    axes.add_collection(areas, autolim=False)
    axes.add_collection(edges, autolim=False)
    return areas


def draw_sensors(
    axes: Axes,
    sensors: pd.DataFrame,
    colours: Sequence[str],
    markers: Mapping[str, str],
    size_pt: float = 3.0,
    alpha: float = 1.0,
) -> None:
    """Draw a dot for each sensor in its colour, with the marker of its type."""
    for kind, marker in markers.items():
        chosen = (sensors["type"] == kind).to_numpy()
        places = to_page(sensors.loc[chosen, ["x_m", "y_m"]].to_numpy(dtype=np.float64))
        axes.scatter(
            places[:, 0],
            places[:, 1],
            s=size_pt**2,
            c=[colour for colour, is_kind in zip(colours, chosen, strict=True) if is_kind],
            marker=marker,
            edgecolors="black",
            linewidths=0.4,
            alpha=alpha,
            zorder=4.0,
        )


def assign_markers(sensors: pd.DataFrame) -> dict[str, str]:
    """Assign a marker to each type of sensor."""
    kinds = sorted(sensors["type"].unique())
    return {kind: MARKERS[i % len(MARKERS)] for i, kind in enumerate(kinds)}


def make_type_handles(markers: Mapping[str, str]) -> list[Line2D]:
    """Make the legend entries of the types of sensors; none if there is only one type."""
    if len(markers) < 2:
        return []
    return [
        Line2D([], [], ls="none", marker=marker, mfc="none", mec="black", ms=4, label=kind)
        for kind, marker in markers.items()
    ]
