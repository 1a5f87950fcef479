"""Top and side views of a robot, with outline and sensor poses."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from evoros.base.arrays import Array
from evoros.drive.rolling import shape_points
from evoros.geometry.footprint import convex_hull
from evoros.robot.model import Robot
from evoros.robot.outline import SolidShape

from .style import BLUE, CATEGORIES, PAGE_IN, render, use_style

X, Y, Z = range(3)
_HEADING_M = 0.03  # length [m] of a sensor's heading line
_BODY, _WHEEL, _CASTER = "body", "driven wheel", "caster"
_COLOURS = {_BODY: "0.88", _WHEEL: "0.45", _CASTER: "0.65"}
_EDGE = "0.35"


def draw_robot_picture(robot: Robot, places: Mapping[str, Array]) -> bytes:
    """Draw a robot from the top and from the right as a PNG, with sensor poses (n, 5) by region."""
    with use_style():
        figure = Figure(figsize=(PAGE_IN, 0.5 * PAGE_IN), layout="constrained")
        length, width = np.ptp(robot.outline, axis=0)
        above, side = figure.subplots(1, 2, width_ratios=(width, length))
        _draw_view(above, robot, (Y, X))
        _draw_view(side, robot, (X, Z))
        closed = np.vstack((robot.outline, robot.outline[:1]))
        above.plot(*closed[:, ::-1].T, color=BLUE, lw=1.0, ls="--", zorder=3)
        side.axhline(0.0, color="0.3", lw=0.8, zorder=0)
        for colour, poses in zip(_cycle(len(places)), places.values(), strict=True):
            _draw_places(above, side, poses, colour)
        above.set(xlabel="y, left [m]", ylabel="x, forward [m]", title="top view", aspect="equal")
        above.invert_xaxis()
        side.set(xlabel="x, forward [m]", ylabel="z [m]", title="side view", aspect="equal")
        entries = _legend(robot, places)
        figure.legend(handles=entries, loc="outside lower center", ncols=4, frameon=False)
    return render(figure, "png")


def _draw_view(axes: Axes, robot: Robot, plane: tuple[int, int]) -> None:
    # Draw the part nearest to the viewer (highest or rightmost) last.
    parts = [(shape_points(part.shape, part.pose), part) for part in robot.visuals]
    parts.sort(key=lambda item: item[0][:, Z].max() if Z not in plane else -item[0][:, Y].min())
    for points, part in parts:
        colour = _COLOURS[_name_kind(robot, part)]
        hull = convex_hull(points[:, list(plane)])
        axes.fill(*hull.T, fc=colour, ec=_EDGE, lw=0.5, alpha=0.85, zorder=1)


def _name_kind(robot: Robot, part: SolidShape) -> str:
    if not part.rolls:
        return _BODY
    return _CASTER if part.link in robot.drive.caster_links else _WHEEL


def _draw_places(above: Axes, side: Axes, poses: Array, colour: str) -> None:
    yaw, pitch = poses[:, 3], poses[:, 4]
    ahead = np.cos(pitch)
    steps = np.stack((ahead * np.cos(yaw), ahead * np.sin(yaw), np.sin(pitch)), axis=1)
    lines = np.stack((poses[:, :3], poses[:, :3] + _HEADING_M * steps))
    for axes, (across, up) in ((above, (Y, X)), (side, (X, Z))):
        axes.plot(lines[..., across], lines[..., up], color=colour, lw=0.4, alpha=0.6, zorder=4)
        axes.scatter(poses[:, across], poses[:, up], s=3.0, c=colour, lw=0.0, zorder=5)


def _cycle(count: int) -> Sequence[str]:
    colours = [colour for colour in CATEGORIES if colour != BLUE]
    return [colours[i % len(colours)] for i in range(count)]


def _legend(robot: Robot, places: Mapping[str, Array]) -> list[Patch | Line2D]:
    drawn = {_name_kind(robot, part) for part in robot.visuals}
    handles: list[Patch | Line2D] = [
        Patch(fc=colour, ec=_EDGE, label=kind) for kind, colour in _COLOURS.items() if kind in drawn
    ]
    handles.append(Line2D([], [], color=BLUE, ls="--", lw=1.0, label="outline"))
    for name, colour in zip(places, _cycle(len(places)), strict=True):
        handles.append(Line2D([], [], color=colour, ls="", marker=".", label=f"sensors: {name}"))
    return handles
