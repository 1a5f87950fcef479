"""Draws the tasks of the study of eyes with the ways of champions, and their designs."""

import math
from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Wedge

import evoros
from evoros.analysis.drawing.style import BLUE, COLUMN_IN, VERMILLION, use_style
from evoros.analysis.drawing.worlds import draw_obstacles
from evoros.base.arrays import Array
from evoros.formats.sdf.reader import read_sdf
from evoros.session.rebuilding import rebuild
from evoros.world.model import World

Runs = Mapping[tuple[str, int], evoros.Run]
COLOURS = {"navigation": BLUE, "detection": VERMILLION}
WIDTH_IN = 1.5 * COLUMN_IN
BODY_M, REACH_M = 0.19, 0.45  # radius of the robot, and of the cones in pictures
SCENE_M = 3.4  # of pictures of two objects, from home to each side
BANDWIDTH_DEG = 12.0  # of the density of bearings
MAZES, SCENES = 3, ("left", "right", "behind_left")


def read_world(run: evoros.Run, name: str) -> World:
    """Return the world of the champion's mission."""
    file = run.path / "champion" / f"world_{name}.sdf"
    course = rebuild(run.path).experiment.world[name].course
    return World(name, read_sdf(file.read_bytes(), str(file)).bodies, course, str(file), "")


def draw_way(axes: Axes, run: evoros.Run, name: str, colour: str) -> None:
    """Draw the world of the champion's mission and its way, with the heading at its begin."""
    world, way = read_world(run, name), run.trajectory(name)
    draw_obstacles(axes, world)
    for x, y in world.course.waypoints:
        axes.add_patch(Circle((x, y), world.course.acceptance_m, fc="none", ec="0.5", lw=0.6))
    axes.plot(way.x_m, way.y_m, color=colour, lw=1.0)
    x, y, _, yaw = world.course.home
    axes.quiver(x, y, math.cos(yaw), math.sin(yaw), scale=12, width=0.012, zorder=5)
    axes.set_aspect("equal")
    axes.tick_params(labelsize="small", length=2)


def draw_tasks(runs: Runs) -> Figure:
    """Draw mazes above and scenes with two objects below, with the champions' ways."""
    with use_style():
        figure = Figure(figsize=(WIDTH_IN, 0.55 * WIDTH_IN), layout="constrained")
        upper, lower = figure.subplots(2, MAZES, height_ratios=(1.0, 1.6))
        for seed, axes in enumerate(upper):
            draw_way(axes, runs["navigation", seed], "mazes", COLOURS["navigation"])
            axes.set_title(f"maze, champion {seed}")
        for name, axes in zip(SCENES, lower, strict=True):
            draw_way(axes, runs["detection", 0], name, COLOURS["detection"])
            axes.set_title(f"narrow one {name.replace('_', ' ')}")
            axes.set(xlim=(-SCENE_M, SCENE_M), ylim=(-SCENE_M, SCENE_M), xlabel="x [m]")
        for row in (upper, lower):
            row[0].set_ylabel("y [m]")
    return figure


def list_bearings(design: pd.DataFrame) -> Array:
    """Return the bearings [rad] of eyes from the middle of the robot."""
    bearings: Array = np.arctan2(design.y_m.to_numpy(float), design.x_m.to_numpy(float))
    return bearings


def draw_design(axes: Axes, run: evoros.Run, colour: str) -> None:
    """Draw a design from above, forward up: the body, and the zones of each eye."""
    genes = run.genes.set_index("gene").value
    width, zones = float(genes.field_of_view), int(genes.zones)
    axes.add_patch(Circle((0, 0), BODY_M, fc="0.9", ec="0.4", lw=0.5))
    axes.annotate("", (0, 0.12), (0, -0.06), arrowprops={"arrowstyle": "->", "lw": 0.6})
    for x, y, yaw in run.champion[["x_m", "y_m", "yaw_deg"]].to_numpy(float).tolist():
        middle, place = 90.0 + yaw, (-y, x)
        for zone in range(zones):
            low = middle - width / 2 + zone * width / zones
            high = low + max(width / zones, 0.8)
            wedge = Wedge(place, REACH_M, low, high, fc=colour, ec="white", lw=0.15, alpha=0.45)
            axes.add_patch(wedge)
        axes.plot(*place, "o", color=colour, ms=2.0)
    reach = BODY_M + REACH_M
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
    axes.axis("off")


def draw_density(axes: Axes, runs: Runs) -> None:
    """Draw the density of bearings for each task: each design counts the same."""
    angles = np.radians(np.arange(361.0))
    kappa = 1.0 / math.radians(BANDWIDTH_DEG) ** 2
    axes.plot(angles, np.ones_like(angles), color="0.5", lw=0.8, ls=":", label="uniform")
    for task, colour in COLOURS.items():
        designs = [run.champion for (name, _), run in runs.items() if name == task]
        curves = [
            np.exp(kappa * (np.cos(angles[:, None] - list_bearings(d)) - 1.0)).mean(axis=1)
            for d in designs
        ]
        mean = np.mean(curves, axis=0)
        axes.plot(angles, mean / mean[:-1].mean(), color=colour, lw=1.2, label=task)
    axes.set_theta_zero_location("N")  # type: ignore[attr-defined]
    axes.set_xticks(np.radians([0, 90, 180, 270]), ["ahead", "left", "behind", "right"])
    axes.set_yticks([1, 2, 3], ["", "", ""])
    axes.tick_params(pad=-1)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), frameon=False)


def draw_designs(runs: Runs) -> Figure:
    """Draw the champions of both tasks, in rows of five, and the density of bearings beside."""
    with use_style():
        figure = Figure(figsize=(WIDTH_IN, 0.56 * WIDTH_IN), layout="constrained")
        left, right = figure.subfigures(1, 2, width_ratios=(2.2, 1.0), squeeze=False)[0]
        panels = left.subplots(4, 5)
        for axes in panels.flat:
            axes.axis("off")
        for index, (task, colour) in enumerate(COLOURS.items()):
            chosen = [(seed, run) for (name, seed), run in runs.items() if name == task]
            places = panels[2 * index : 2 * index + 2].flat
            for axes, (seed, run) in zip(places, chosen, strict=False):
                draw_design(axes, run, colour)
                axes.set_title(f"{task} {seed}", fontsize="x-small", pad=1)
        draw_density(right.add_subplot(projection="polar"), runs)
    return figure
