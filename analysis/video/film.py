"""How a mission is filmed: which pictures, from where, and what they say."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated

import numpy as np
import pandas as pd

from evoros.base.arrays import Array
from evoros.base.checks import NOT_NEGATIVE, POSITIVE, Rule, checked, invalid, is_whole, one_of
from evoros.base.errors import InputError
from evoros.storage.figure_context import FigureContext
from evoros.world.model import World

from .camera import Camera, above, chase
from .captions import CLEAR, FAILED, NEAR, Caption
from .motion import Motion

CAMERAS = ("chase", "above")
SIZE = Rule(
    "two even whole numbers of pixels, from 64 to 4096",
    lambda v: len(v) == 2 and all(is_whole(e) and 64 <= e <= 4096 and e % 2 == 0 for e in v),
)
_CALM_S = 0.7  # of video: how slowly the camera that follows turns
_MARGIN_M = 1.5  # around what the camera above sees, for the strips with text


@dataclass(frozen=True)
@checked
class Film:
    """How a mission is shown."""

    camera: Annotated[str, one_of(*CAMERAS)] = "chase"  # behind the robot; above: the whole course
    size: Annotated[tuple[int, int], SIZE] = (854, 480)  # width, height
    fps: Annotated[float, POSITIVE] = 25.0  # pictures per second of video
    speed: Annotated[float, POSITIVE] = 10.0  # times as fast as it was
    start_s: Annotated[float, NOT_NEGATIVE] = 0.0
    end_s: float = math.inf  # of the mission; its end, where it ends before
    title: str = ""

    def __post_init__(self) -> None:
        if not self.end_s > self.start_s:
            raise invalid(self, "end_s", self.end_s, "must be greater than start_s")


def times(trajectory: pd.DataFrame, film: Film) -> Array:
    """(n,) [s]: of each picture; the last is that of the end."""
    first, last = (float(trajectory["time_s"].iloc[row]) for row in (0, -1))
    start, end = max(film.start_s, first), min(film.end_s, last)
    if start > end:
        raise InputError(
            f"from {film.start_s:g} s: must be before the mission ends at {last:g} s; begin earlier"
        )
    step = film.speed / film.fps
    count = math.ceil((end - start) / step - 1e-9) + 1
    times: Array = np.minimum(start + step * np.arange(count), end)
    return times


def cameras(moves: Motion, world: World, places: Array, film: Film) -> Iterator[Camera]:
    """Of each picture; ``places`` (n, 2) [m] are all that the robot comes to."""
    if film.camera == "above":
        points = np.vstack([places, world.course.route(True)])
        margin = world.course.acceptance_m + _MARGIN_M
        camera = above(points.min(axis=0) - margin, points.max(axis=0) + margin, film.size)
        yield from [camera] * len(moves.time_s)
        return
    yaws = _calm(moves.yaw_rad, _CALM_S * film.fps)
    for x, y, yaw in zip(moves.x_m, moves.y_m, yaws, strict=True):
        yield chase(float(x), float(y), float(yaw), film.size)


def _calm(values: Array, sigma: float) -> Array:
    """Values (n,), each the mean of those around it, weighted by a normal distribution."""
    reach = math.ceil(3 * sigma)
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    wider = np.pad(values, reach, mode="edge")
    calm: Array = np.convolve(wider, weights / weights.sum(), mode="valid")
    return calm


def captions(
    trajectory: pd.DataFrame, moves: Motion, world: World, setting: FigureContext, film: Film
) -> Iterator[Caption]:
    """Of each picture, without the states of the sensors."""
    key = ((CLEAR, "clear"), (NEAR, "near"), (FAILED, "failed or silent"))
    end, goals_there = float(trajectory["time_s"].iloc[-1]), len(world.course.route(True))
    contacts = trajectory.get("contact", pd.Series(0, trajectory.index)).to_numpy() > 0
    modes = ("none", *setting.modes)
    for time, row in zip(moves.time_s, moves.record, strict=True):
        visited, mode = int(trajectory["visited"].iloc[row]), int(trajectory["mode"].iloc[row])
        doing = "collision" if contacts[row] else modes[mode] if mode < len(modes) else str(mode)
        at = "completed" if visited == goals_there else f"waypoint {visited + 1} of {goals_there}"
        said = (film.title, f"{time:.0f} s of {end:.0f} s", at, doing)
        yield Caption(said, f"{film.speed:g} x real time", (), key)
