"""Draws a mission on a map: path by mode, collisions, failures and legend."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import SubFigure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch

from evoros.base.arrays import Array
from evoros.storage.figure_context import FigureContext
from evoros.world.model import World

from ..designs.cones import outline_part
from ..tables.readings import WalkerTrack
from ..tables.tracks import NONE, TOUCHED
from . import faults
from .style import BLACK, BLUE, GREEN, HALO, ORANGE, PURPLE, SKY, VERMILLION
from .worlds import draw_course, draw_obstacles

_ESTIMATED = Line2D([], [], color=BLACK, lw=0.9, ls=(0, (3, 1.5)), label="estimated path")
OBSTACLE = "0.8"
# Colour and width [pt] of the path by mode, in the order of the controller's layers.
PATHS = ((VERMILLION, 1.6), (BLUE, 0.8), (GREEN, 1.2), (PURPLE, 1.6))
UNDECIDED = ("0.3", 0.8)
_POINT: dict[str, Any] = {"ls": "none", "zorder": 5}
HOME = {**_POINT, "marker": "*", "color": "black", "ms": 6, "label": "home (arrow: start)"}
WAYPOINT = {**_POINT, "marker": "o", "mfc": "none", "mec": "0.5", "ms": 7}
WAYPOINT["label"] = "waypoint"
END = {**_POINT, "marker": "D", "ms": 3.5, "mfc": "white", "mec": "black", "mew": 0.9}
END["label"] = "end"
COLLISION = {**_POINT, "marker": "X", "ms": 7, "mfc": "black", "mec": "white", "mew": 0.6}
COLLISION["label"] = "collision"
TOUCH = {**_POINT, "marker": "s", "ms": 9, "mfc": "none", "mec": PURPLE, "mew": 1.2}
TOUCH["label"] = "bumper closed (number)"
_WAY: dict[str, Any] = {"color": SKY, "lw": 0.5, "ls": (0, (1, 1.5)), "alpha": 0.6}
_TIME: dict[str, Any] = {"fontsize": "x-small", "zorder": 4.7, "textcoords": "offset points"}
_TIME["xytext"] = (3, 2)
_MARK: dict[str, Any] = {"ls": "none", "marker": "o", "mec": "black", "mew": 0.4, "ms": 6}
POSE = ("x_m", "y_m", "yaw_rad")
COLOURS = (ORANGE, SKY, PURPLE)  # distinct from the main robot's colours if it has few modes
ROBOT_DASHES = ((0, (4, 1)), (0, (4, 1, 1, 1)), (0, (1.5, 1)))
_WIDTH_PT = 1.3
_HIT: dict[str, Any] = {"mfc": "black", "mec": "white", "mew": 0.6}
_MEETING: dict[str, Any] = {"marker": "s", "mfc": "white", "mec": "black", "ms": 5}
_NEAR_LABEL: dict[str, Any] = {"textcoords": "offset points", "fontsize": "small", "zorder": 6}


def draw_mission(
    axes: Axes,
    world: World,
    path: pd.DataFrame,
    modes: Sequence[str],
    effects: Mapping[str, str] | None = None,
) -> None:
    """Draw a mission in its world; its context provides ``modes`` and ``effects``."""
    draw_obstacles(axes, world).set(array=None, facecolor=OBSTACLE, zorder=1)
    draw_course(axes, world.course)
    axes.set_aspect("equal")
    if path.empty:
        return
    for phase, part in faults.split_by_phase(path):
        _draw_phase(axes, phase, part, modes)
    if has_estimate(path):
        places = path["estimated_x_m"], path["estimated_y_m"]
        axes.plot(*places, color=BLACK, lw=0.9, ls=(0, (3, 1.5)), zorder=3)
    faults.draw_arrow(axes, path)
    axes.plot(path["x_m"].iloc[-1], path["y_m"].iloc[-1], **END)
    touched = path["contact"].diff().fillna(path["contact"]) > 0
    axes.plot(path["x_m"][touched], path["y_m"][touched], **COLLISION)
    faults.draw_faults(axes, path, effects or {})
    if TOUCHED in path:
        closed = path[path[TOUCHED].fillna("") != ""]  # empty if only another robot has bumpers
        axes.plot(closed["x_m"], closed["y_m"], **TOUCH)
        faults.write_numbers(axes, closed, TOUCHED, (5, -9))


def _draw_phase(axes: Axes, phase: int, path: pd.DataFrame, modes: Sequence[str]) -> None:
    stretches = list(faults.split_by_mode(path))
    for name, (colour, width) in _styles(modes).items():
        driven = [stretch for mode, stretch in stretches if mode == name]
        if driven:
            look = {"colors": colour, "linewidths": width, "linestyles": faults.DASHES[phase]}
            lines = LineCollection(driven, zorder=2.5, label=name, **look)
            axes.add_collection(lines)
    faults.draw_direction(axes, path, phase)


def _styles(modes: Sequence[str]) -> dict[str, tuple[str, float]]:
    # draw the path of the last layer first
    styles = {name: PATHS[i % len(PATHS)] for i, name in enumerate(modes)}
    return dict(reversed([*styles.items(), (NONE, UNDECIDED)]))


def make_handles(
    tracks: pd.DataFrame,
    modes: Sequence[str],
    touched: bool,
    effects: Mapping[str, str] | None = None,
) -> list[Artist]:
    """Make the legend entries for the main robot and for collisions."""
    driven = set(tracks["mode"])
    handles: list[Artist] = [
        Line2D([], [], color=colour, lw=width, label=name)
        for name, (colour, width) in reversed(_styles(modes).items())
        if name in driven
    ]
    if has_estimate(tracks):
        handles.append(_ESTIMATED)
    handles += faults.make_phase_handles(tracks)
    handles += [Line2D([], [], **HOME), Line2D([], [], **END), Line2D([], [], **WAYPOINT)]
    handles.append(Line2D([], [], color="0.5", lw=0.7, ls=":", label="course"))
    handles.append(Patch(fc=OBSTACLE, ec="black", lw=0.3, label="obstacle"))
    if touched:
        handles.append(Line2D([], [], **COLLISION))
    handles += faults.make_fault_handles(tracks, effects or {})
    if TOUCHED in tracks and (tracks[TOUCHED].fillna("") != "").any():
        handles.append(Line2D([], [], **TOUCH))
    return handles


def has_estimate(tracks: pd.DataFrame) -> bool:
    """Return True if the missions recorded an estimated pose."""
    return "estimated_x_m" in tracks


def draw_errors(figure: SubFigure, paths: Mapping[str, pd.DataFrame], columns: int) -> None:
    """Draw a panel per mission: position and heading errors over the distance driven."""
    rows = -(-len(paths) // columns)
    grid = figure.subplots(rows, columns, squeeze=False, sharey=True)
    panels: Sequence[Axes] = list(grid.flat)
    twins = []
    for axes, path in zip(panels, paths.values(), strict=False):
        way, place, heading = measure_drift(path)
        if not len(way):  # the mission did not run
            way, place, heading = np.zeros((3, 1))
        axes.plot(way, place, color=BLUE, lw=1.0)
        axes.set(xlabel="distance driven [m]", xlim=(0.0, max(float(way[-1]), 1e-3)))
        twin = axes.twinx()
        twin.plot(way, heading, color=VERMILLION, lw=0.9, ls="-.")
        twin.spines["right"].set_visible(True)
        twins.append(twin)
    panels[0].set_ylim(0.0, max(axes.get_ylim()[1] for axes in panels[: len(paths)]))
    high = max(twin.get_ylim()[1] for twin in twins)
    for index, twin in enumerate(twins):
        last = index % columns == columns - 1 or index == len(twins) - 1
        twin.set(ylim=(0.0, high), ylabel="heading error [deg]" if last else "")
        twin.tick_params(labelright=last, colors=VERMILLION, which="both")
        twin.yaxis.label.set_color(VERMILLION)
    for axes in panels[len(paths) :]:
        axes.set_axis_off()
    for row in grid:
        row[0].set_ylabel("position error [m]", color=BLUE)
        row[0].tick_params(axis="y", colors=BLUE)


def measure_drift(path: pd.DataFrame) -> tuple[Array, Array, Array]:
    """Return the distance driven [m], the position error [m] and heading error [deg], each (n,)."""
    # the estimate in the last row belongs to an earlier decision
    rows = path.iloc[:-1] if len(path) > 1 else path
    x, y = rows["x_m"].to_numpy(float), rows["y_m"].to_numpy(float)
    steps = np.hypot(np.diff(x, prepend=x[:1]), np.diff(y, prepend=y[:1]))
    aside = rows["estimated_x_m"].to_numpy(float) - x, rows["estimated_y_m"].to_numpy(float) - y
    turn = rows["estimated_yaw_rad"].to_numpy(float) - rows["yaw_rad"].to_numpy(float)
    heading = np.abs(np.degrees(np.arctan2(np.sin(turn), np.cos(turn))))
    return np.cumsum(steps), np.hypot(*aside), heading


def draw_companions(
    axes: Axes,
    path: pd.DataFrame,
    others: Mapping[str, pd.DataFrame],
    robots: Mapping[str, FigureContext],
) -> None:
    """Draw the paths of the other robots, and their closest approaches to the main robot."""
    for place, (name, other) in enumerate(others.items()):
        if len(path) and len(other):
            style = _choose_style(place)
            _draw_path(axes, other, style)
            _draw_meeting(axes, (path, other), (robots[""], robots[name]), style["color"])


def _choose_style(place: int) -> dict[str, Any]:
    colour, dashes = COLOURS[place % len(COLOURS)], ROBOT_DASHES[place % len(ROBOT_DASHES)]
    return {"color": colour, "ls": dashes, "lw": _WIDTH_PT}


def _draw_path(axes: Axes, path: pd.DataFrame, style: Mapping[str, Any]) -> None:
    axes.plot(path["x_m"], path["y_m"], zorder=2.4, **style)
    x, y = path["x_m"].iloc[0], path["y_m"].iloc[0]
    axes.plot(x, y, marker="*", mfc=style["color"], mec="black", mew=0.4, ms=7, zorder=5)
    hits = path[path["contact"].diff().fillna(path["contact"]) > 0]
    axes.plot(hits["x_m"], hits["y_m"], ls="none", marker="X", ms=7, zorder=5, **_HIT)


def _draw_meeting(
    axes: Axes, paths: Sequence[pd.DataFrame], robots: Sequence[FigureContext], colour: str
) -> None:
    both = paths[0].merge(paths[1], on="time_s", suffixes=("", "_other"))
    first = both[[*POSE]].to_numpy(float)
    other = both[[f"{name}_other" for name in POSE]].to_numpy(float)
    row = int(np.argmin(np.hypot(*(first - other)[:, :2].T)))
    _draw_outline(axes, robots[0], first[row].tolist(), "white")
    _draw_outline(axes, robots[1], other[row].tolist(), colour)
    x, y = ((first[row] + other[row]) / 2).tolist()[:2]
    time_s = float(both["time_s"].to_numpy(float)[row])
    axes.annotate(f"{time_s:.0f} s", (x, y), xytext=(7, 5), **_NEAR_LABEL)


def _draw_outline(axes: Axes, robot: FigureContext, pose: Sequence[float], colour: str) -> None:
    parts = sorted(robot.parts, key=lambda part: part.top_m)
    areas = [_place(outline_part(part), pose) for part in parts]
    colours = ["0.25" if part.wheel else colour for part in parts]
    axes.add_collection(
        PolyCollection(areas, facecolors=colours, edgecolors="black", linewidths=0.4, zorder=4.5),
        autolim=False,
    )


def _place(points: Array, pose: Sequence[float]) -> Array:
    x, y, yaw = pose
    cos, sin = math.cos(yaw), math.sin(yaw)
    placed: Array = points @ np.array([[cos, sin], [-sin, cos]]) + np.array([x, y])
    return placed


def make_companion_handles(names: Sequence[str]) -> list[Line2D]:
    """Make the legend entries for the other robots."""
    handles = [Line2D([], [], label=name, **_choose_style(i)) for i, name in enumerate(names)]
    if handles:
        handles.append(Line2D([], [], ls="none", label="closest approach (time)", **_MEETING))
    return handles


def draw_walkers(axes: Axes, walkers: Sequence[WalkerTrack], path: pd.DataFrame) -> None:
    """Draw each walker at its first contact or closest approach, labelled with the time [s]."""
    if path.empty:
        return
    times, places = path["time_s"].to_numpy(float), path[["x_m", "y_m"]].to_numpy(float)
    for walker in walkers:
        shown = walker.time_s <= times[-1] + 1e-6
        axes.plot(*walker.places[shown].T, zorder=1.5, **_WAY)
        touch = walker.find_touch(0)
        if touch is not None and not shown[touch]:
            touch = None
        row = _find_nearest(walker.places[shown], places) if touch is None else touch
        x, y = walker.places[row].tolist()
        colour = SKY if touch is None else VERMILLION
        circle = Circle((x, y), walker.radius_m, fc=colour, ec="black", lw=0.4, zorder=4.6)
        axes.add_patch(circle)
        axes.annotate(f"{walker.time_s[row]:.0f}", (x, y), path_effects=[HALO], **_TIME)


def _find_nearest(walker: Array, robot: Array) -> int:
    count = min(len(walker), len(robot))
    apart = walker[:count] - robot[:count]
    return int(np.nanargmin((apart * apart).sum(axis=1)))


def make_walker_handles(walkers: Sequence[WalkerTrack]) -> list[Artist]:
    """Make the legend entries for the walkers."""
    if not walkers:
        return []
    handles: list[Artist] = [
        Line2D([], [], label="path of a walker", **_WAY),
        Line2D([], [], mfc=SKY, label="walker, closest (time)", **_MARK),
    ]
    if any(walker.find_touch(0) is not None for walker in walkers):
        handles.append(Line2D([], [], mfc=VERMILLION, label="walker, touched (time)", **_MARK))
    return handles
