"""Top views of worlds: obstacles coloured by height, courses and robot tracks."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Patch, Polygon

from evoros.base.arrays import Array
from evoros.geometry.footprint import Footprint, find_heights, project_shape
from evoros.world.course import Course
from evoros.world.model import World
from evoros.world.standing import standing_obstacles

from ..designs.cones import dilate
from .style import COLUMN_IN, HALO, VERMILLION, render, use_style

HEIGHTS_M = Normalize(0.0, 1.0)
_NUMBER: dict[str, Any] = {"fontsize": "x-small", "ha": "center", "va": "center", "zorder": 4.8}
PICTURE_IN = 4.5  # width [in] of a picture per world
OVERHEAD_M = 1.0  # height [m] above which parts hide nothing that robots can touch or see


def draw_world_picture(worlds: Mapping[str, World]) -> bytes:
    """Draw worlds and their courses in top view as a PNG."""
    figure = draw_worlds(worlds, width=PICTURE_IN * len(worlds))
    axes = figure.axes[0]
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    figure.set_figheight(1.0 + (PICTURE_IN - 1.2) * (high - low) / (right - left))
    return render(figure, "png")


def draw_worlds(
    worlds: Mapping[str, World],
    tracks: Mapping[str, Sequence[Array]] | None = None,
    width: float = 2 * COLUMN_IN,
) -> Figure:
    """Draw the worlds side by side, with tracks (n, 2) [m] as lines."""
    with use_style():
        figure = Figure(figsize=(width, 1.1 * width / len(worlds)), layout="constrained")
        panels = figure.subplots(1, len(worlds), squeeze=False, sharex=True, sharey=True)[0]
        for axes, (name, world) in zip(panels, worlds.items(), strict=True):
            solids = draw_obstacles(axes, world)
            for track in (tracks or {}).get(name, ()):
                axes.plot(*track.T, color=VERMILLION, lw=0.7, alpha=0.8)
            draw_course(axes, world.course)
            axes.set_title(name)
            axes.set_xlabel("x [m]")
            axes.set_aspect("equal")
        panels[0].set_ylabel("y [m]")
        bar = figure.colorbar(solids, ax=list(panels), shrink=0.8, pad=0.01, extend="max")
        bar.set_label("height [m]")
    return figure


def draw_obstacles(
    axes: Axes, world: World, cmap: str = "cividis_r", heights: Normalize = HEIGHTS_M
) -> PatchCollection:
    """Draw obstacles, coloured by height; of lintels and roofs, draw only the edges."""
    patches: list[Patch] = []
    overhead: list[Patch] = []
    tops: list[float] = []
    for body in standing_obstacles(world):
        for shape, pose in body.placed:
            patch = _to_patch(project_shape(shape, pose))
            bottom, top = find_heights(shape, pose)
            if bottom > OVERHEAD_M:
                overhead.append(patch)
                continue
            patches.append(patch)
            tops.append(top)
    solids = PatchCollection(patches, cmap=cmap, norm=heights, ec="black", lw=0.3)
    solids.set_array(np.array(tops))
    axes.add_collection(solids)
    if overhead:
        edges = PatchCollection(overhead, fc="none", ec="0.6", lw=0.3, ls=":")
        axes.add_collection(edges)
    axes.autoscale()
    return solids


def _to_patch(area: Footprint) -> Patch:
    if len(area.vertices) == 1:
        return Circle((area.vertices[0, 0], area.vertices[0, 1]), area.radius)
    # A tilted cylinder, even if tilted only by rounding errors, is a segment with a radius.
    return Polygon(dilate(area.vertices, area.radius))


def draw_course(axes: Axes, course: Course) -> None:
    """Draw the route, home as a star, and numbered waypoints with acceptance circles."""
    axes.plot(*course.first_phase.T, color="0.5", lw=0.7, ls=":")
    numbers: dict[Sequence[float], list[str]] = {}
    for index, place in enumerate(course.waypoints, 1):
        numbers.setdefault(place, []).append(str(index))
    for (x, y), names in numbers.items():
        axes.add_patch(Circle((x, y), course.acceptance_m, fill=False, ec="0.5", lw=0.7))
        axes.text(x, y, ", ".join(names), path_effects=[HALO], **_NUMBER)
    axes.plot(*course.home[:2], marker="*", color="black", ms=6, ls="none")
