"""Sensors that cast no rays, on a robot from above: their places, and the zones of bumpers."""

from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from evoros.base.arrays import Array
from evoros.sensor.protocol import CONTACT, MOTION, WHEELS
from evoros.storage.figure_context import FigureContext

from ..designs.cones import trace_zone
from .robot import to_page
from .style import PURPLE

_MARKERS = {WHEELS: ("p", 6.5), MOTION: ("X", 4.0), CONTACT: ("*", 4.0)}
"""Marker and size [pt] by what a sensor measures."""
_HATCH = "/////"


def draw_signals(
    axes: Axes, signals: pd.DataFrame, context: FigureContext, alpha: float = 1.0
) -> None:
    """Draw each sensor's place, and the zone of each bumper up to the edge of the robot."""
    bumpers = signals[signals["width_m"] > 0.0]
    zones = [to_page(zone) for zone in trace_zones(bumpers, context)]
    look: dict[str, Any] = {"facecolors": "none", "edgecolors": PURPLE, "linewidths": 0.6}
    drawn = PolyCollection(zones, hatch=_HATCH, alpha=alpha, zorder=3.5, **look)
    axes.add_collection(drawn, autolim=False)
    for order, measures in enumerate(_MARKERS):  # a smaller marker is drawn later
        shown = (signals["measures"] == measures) & (signals["width_m"] <= 0.0)
        places = to_page(signals.loc[shown, ["x_m", "y_m"]].to_numpy(float))
        axes.plot(*places.T, **_style(measures), alpha=alpha, zorder=4.5 + 0.01 * order)


def trace_zones(bumpers: pd.DataFrame, context: FigureContext) -> list[Array]:
    """Return the corners (4, 2) [m] of the zone of each bumper on a robot."""
    columns = ["x_m", "y_m", "yaw_deg", "width_m", "depth_m"]
    rows = bumpers[columns].to_numpy(float).tolist()
    return [trace_zone((x, y), yaw, width, depth, context) for x, y, yaw, width, depth in rows]


def make_signal_handles(signals: pd.DataFrame) -> list[Line2D | Patch]:
    """Make a legend entry for each type."""
    kinds = signals.drop_duplicates("type")
    return [
        Patch(fc="none", ec=PURPLE, hatch=_HATCH, lw=0.6, label=f"{kind}, its zone")
        if width > 0.0
        else Line2D([], [], label=str(kind), **_style(str(measures)))
        for kind, measures, width in zip(
            kinds["type"], kinds["measures"], kinds["width_m"], strict=True
        )
    ]


def _style(measures: str) -> dict[str, Any]:
    marker, size = _MARKERS[measures]
    looks = {"mfc": "white", "mec": "black", "mew": 0.6, "ms": size}
    return {"ls": "none", "marker": marker, **looks}
