"""A robot from above and from the side, with its outline and the places of its sensors."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from evoros.base.arrays import Array
from evoros.geometry.footprint import convex_hull
from evoros.geometry.shapes import Pose, Shape
from evoros.robot.model import Robot

from .style import BLUE, CATEGORIES, PAGE_IN, use_style

X, Y, Z = range(3)
_BODY, _WHEEL, _CASTER, _EDGE = "0.88", "0.45", "0.65", "0.35"
_CIRCLE = np.linspace(0.0, 2.0 * math.pi, 48, endpoint=False)


def draw_inspected_robot(robot: Robot, places: Mapping[str, Array]) -> Figure:
    """Draw a robot from above (its nose up) and from the right side (its nose to the right).

    ``places`` (n, 5) are poses of sensors, as ``Robot.sensor_poses`` gives them, by their region.
    """
    with use_style():
        figure = Figure(figsize=(PAGE_IN, 0.5 * PAGE_IN), layout="constrained")
        length, width = np.ptp(robot.outline, axis=0)
        above, side = figure.subplots(1, 2, width_ratios=(width, length))
        _draw_view(above, robot, (Y, X))
        _draw_view(side, robot, (X, Z))
        above.plot(*_close(robot.outline)[:, ::-1].T, color=BLUE, lw=1.0, ls="--", zorder=3)
        side.axhline(0.0, color="0.3", lw=0.8, zorder=0)
        for colour, poses in zip(_cycle(len(places)), places.values(), strict=True):
            _draw_places(above, side, poses, colour)
        above.set(xlabel="y, left [m]", ylabel="x, forward [m]", title="from above", aspect="equal")
        above.invert_xaxis()
        side.set(xlabel="x, forward [m]", ylabel="z [m]", title="from the side", aspect="equal")
        figure.legend(handles=_legend(places), loc="outside lower center", ncols=4, frameon=False)
    return figure


def _draw_view(axes: Axes, robot: Robot, plane: tuple[int, int]) -> None:
    # The nearest part comes last: the highest from above, that with the least y from the right.
    parts = [(_project(part.shape, part.pose), part) for part in robot.visuals]
    parts.sort(key=lambda item: item[0][:, Z].max() if Z not in plane else -item[0][:, Y].min())
    wheels = _driven_links(robot)
    for points, part in parts:
        colour = _BODY if not part.rolls else _WHEEL if part.link in wheels else _CASTER
        hull = convex_hull(points[:, list(plane)])
        axes.fill(*hull.T, fc=colour, ec=_EDGE, lw=0.5, alpha=0.85, zorder=1)


def _driven_links(robot: Robot) -> frozenset[str]:
    return frozenset(part.link for part in robot.visuals if part.rolls) - frozenset(
        robot.drive.caster_links
    )


def _project(shape: Shape, pose: Pose) -> Array:
    """Return points (n, 3) [m] in the robot's frame whose hull is that of the shape."""
    points: Array = _surface_points(shape) @ pose.rotation.T + np.array(pose.position)
    return points


def _surface_points(shape: Shape) -> Array:
    if shape.kind == "convex":
        return np.array(shape.corners)
    if shape.kind == "box":
        signs = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
        box: Array = signs * np.array(shape.size) / 2
        return box
    cos, sin = np.cos(_CIRCLE), np.sin(_CIRCLE)
    if shape.kind == "cylinder":
        radius, length = shape.size
        ends = [np.full_like(cos, end * length / 2) for end in (-1, 1)]
        return np.concatenate([np.stack([radius * cos, radius * sin, end], 1) for end in ends])
    zero = np.zeros_like(cos)  # a sphere: three great circles
    circles = ((cos, sin, zero), (cos, zero, sin), (zero, cos, sin))
    points: Array = shape.size[0] * np.concatenate([np.stack(circle, 1) for circle in circles])
    return points


def _draw_places(above: Axes, side: Axes, poses: Array, colour: str) -> None:
    """Draw a dot for each place, and a short line in the direction in which the sensor looks."""
    length = 0.03
    for x, y, z, yaw, pitch in poses.tolist():
        ahead = length * math.cos(pitch)
        tip_x, tip_y = x + ahead * math.cos(yaw), y + ahead * math.sin(yaw)
        above.plot([y, tip_y], [x, tip_x], color=colour, lw=0.4, alpha=0.6, zorder=4)
        tip_z = z + length * math.sin(pitch)
        side.plot([x, tip_x], [z, tip_z], color=colour, lw=0.4, alpha=0.6, zorder=4)
    above.scatter(poses[:, 1], poses[:, 0], s=3.0, c=colour, lw=0.0, zorder=5)
    side.scatter(poses[:, 0], poses[:, 2], s=3.0, c=colour, lw=0.0, zorder=5)


def _close(polygon: Array) -> Array:
    return np.vstack((polygon, polygon[:1]))


def _cycle(count: int) -> Sequence[str]:
    colours = [colour for colour in CATEGORIES if colour != BLUE]
    return [colours[i % len(colours)] for i in range(count)]


def _legend(places: Mapping[str, Array]) -> list[Patch | Line2D]:
    handles: list[Patch | Line2D] = [
        Patch(fc=_BODY, ec=_EDGE, label="body"),
        Patch(fc=_WHEEL, ec=_EDGE, label="driven wheel"),
        Patch(fc=_CASTER, ec=_EDGE, label="caster"),
        Line2D([], [], color=BLUE, ls="--", lw=1.0, label="outline"),
    ]
    for name, colour in zip(places, _cycle(len(places)), strict=True):
        handles.append(Line2D([], [], color=colour, ls="", marker=".", label=f"sensors: {name}"))
    return handles
