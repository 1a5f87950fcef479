"""How a mission is shown: times of the pictures, cameras and captions."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated

import numpy as np
import pandas as pd

from evoros.base.arrays import Array
from evoros.base.checks import NOT_NEGATIVE, POSITIVE, Rule, checked, invalid, is_whole, one_of
from evoros.base.errors import InputError
from evoros.filter.protocol import ENDS
from evoros.sensor.protocol import CONTACT
from evoros.world.model import World

from .camera import Camera, chase_camera, overhead_camera
from .captions import CLEAR, ERRING, FAILED, NEAR, Caption
from .mission import FilmedMission
from .motion import Motion

CAMERAS = ("chase", "above")
SIZE = Rule(
    "two even whole numbers of pixels, from 64 to 4096",
    lambda v: len(v) == 2 and all(is_whole(e) and 64 <= e <= 4096 and e % 2 == 0 for e in v),
)
_SMOOTHING_S = 0.7  # of video: standard deviation with which the chase camera's heading is smoothed
_MARGIN_M = 1.5  # around the course, for the strips with text


@dataclass(frozen=True)
@checked
class RenderOptions:
    """How a mission is shown."""

    camera: Annotated[str, one_of(*CAMERAS)] = "chase"  # behind the robot; above: the whole course
    size: Annotated[tuple[int, int], SIZE] = (854, 480)  # width, height
    fps: Annotated[float, POSITIVE] = 25.0  # pictures per second of video
    speed: Annotated[float, POSITIVE] = 10.0  # mission time over video time
    start_s: Annotated[float, NOT_NEGATIVE] = 0.0
    end_s: float = math.inf  # of the mission, or its own end if that is earlier
    title: str = ""

    def __post_init__(self) -> None:
        if not self.end_s > self.start_s:
            raise invalid(self, "end_s", self.end_s, "must be greater than start_s")


def sample_times(trajectory: pd.DataFrame, options: RenderOptions) -> Array:
    """Return the times (n,) [s] of the pictures; the last one is the end."""
    first, last = (float(trajectory["time_s"].iloc[row]) for row in (0, -1))
    start, end = max(options.start_s, first), min(options.end_s, last)
    if start > end:
        raise InputError(
            f"from {options.start_s:g} s: must be before the mission ends at {last:g} s; begin "
            f"earlier"
        )
    step = options.speed / options.fps
    count = math.ceil((end - start) / step - 1e-9) + 1
    times: Array = np.minimum(start + step * np.arange(count), end)
    return times


def place_cameras(
    motion: Motion, world: World, places: Array, options: RenderOptions
) -> Iterator[Camera]:
    """Yield the camera of each picture; ``places`` (n, 2) [m] are all of the robot's."""
    if options.camera == "above":
        points = np.vstack([places, world.course.route(True)])
        margin = world.course.acceptance_m + _MARGIN_M
        low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
        yield from [overhead_camera(low, high, options.size)] * len(motion.time_s)
        return
    from scipy.ndimage import gaussian_filter1d  # takes long to import

    sigma = _SMOOTHING_S * options.fps
    yaws = gaussian_filter1d(motion.yaw_rad, sigma, mode="nearest", radius=math.ceil(3 * sigma))
    for x, y, yaw in zip(motion.x_m, motion.y_m, yaws, strict=True):
        yield chase_camera(float(x), float(y), float(yaw), options.size)


def make_captions(
    mission: FilmedMission, motion: Motion, options: RenderOptions
) -> Iterator[Caption]:
    """Yield the caption of each picture, without the states of the sensors."""
    trajectory, context = mission.trajectory, mission.context
    touches = any(signal.measures == CONTACT for signal in context.signals.values())
    near = "near, touched" if touches else "near"
    key = [(CLEAR, "clear"), (NEAR, near), (FAILED, "failed or silent")]
    if any(fault.kind != ENDS for fault in mission.faults):
        key.append((ERRING, "the more, the greater its error"))
    end, goals = float(trajectory["time_s"].iloc[-1]), len(mission.world.course.route(True))
    contacts = trajectory.get("contact", pd.Series(0, trajectory.index)).to_numpy() > 0
    modes = ("none", *context.modes)
    for time, row in zip(motion.time_s, motion.record, strict=True):
        visited, mode = int(trajectory["visited"].iloc[row]), int(trajectory["mode"].iloc[row])
        state = "collision" if contacts[row] else modes[mode] if mode < len(modes) else str(mode)
        goal = "completed" if visited == goals else f"waypoint {visited + 1} of {goals}"
        failed = ", ".join(part for at, part in mission.failed_parts if at <= time)
        state += f", failed: {failed}" * bool(failed)
        texts = (options.title, f"{time:.0f} s of {end:.0f} s", goal, state)
        yield Caption(texts, f"{options.speed:g} x real time", (), key)
