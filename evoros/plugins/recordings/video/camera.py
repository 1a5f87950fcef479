"""Options, times, cameras and captions for pictures of a mission."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from evoros.base.arrays import Array
from evoros.base.checks import NOT_NEGATIVE, POSITIVE, Rule, checked, invalid, is_whole, one_of
from evoros.base.errors import InputError
from evoros.filter.protocol import ENDS
from evoros.geometry.shapes import Pose
from evoros.plugins.recordings.missions import RecordedMission
from evoros.plugins.recordings.video.captions import CLEAR, ERRING, FAILED, NEAR, Caption
from evoros.plugins.recordings.video.motion import Motion
from evoros.sensor.protocol import CONTACT
from evoros.world.model import World

CAMERAS = ("chase", "above")
SIZE = Rule(
    "two even numbers of pixels, each from 64 to 4096",
    lambda v: len(v) == 2 and all(is_whole(e) and 64 <= e <= 4096 and e % 2 == 0 for e in v),
)
_SMOOTHING_S = 0.7  # standard deviation [s of video] of the chase camera's heading filter
_MARGIN_M = 1.5  # margin [m] around the course, for the captions
Pixels = NDArray[np.uint8]
Floats = NDArray[np.float32]

NEAR_M = 0.05  # distance [m] below which points are not drawn
BACK_M, UP_M, AHEAD_M = 2.3, 1.9, 0.7  # chase camera's position and target, relative to the robot
CHASE_FOV_DEG, OVERHEAD_FOV_DEG = 50.0, 14.0  # nearly parallel from above: walls hide little


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole camera; pixels are counted from the top left."""

    eye: Array  # (3,) [m]
    target: Array  # (3,) [m]
    up: Array  # (3,) direction that appears upwards; not parallel to the line of sight
    fov_deg: float  # vertical
    size: tuple[int, int]  # width, height

    @cached_property
    def view(self) -> Array:
        """The transform (4, 4) from the world to the camera, which looks along -z (OpenGL)."""
        forward = _normalize(self.target - self.eye)
        right = _normalize(np.cross(forward, self.up))
        matrix = np.eye(4)
        matrix[:3, :3] = right, np.cross(right, forward), -forward
        matrix[:3, 3] = -matrix[:3, :3] @ self.eye
        return matrix

    @property
    def pixels_per_radian(self) -> float:
        """The scale [px/rad] at the centre of the picture."""
        return float(self.size[1] / 2.0 / np.tan(np.radians(self.fov_deg) / 2.0))

    @cached_property
    def pixels(self) -> Array:
        """The projection (3, 4) of (x, y, z, 1) [m] to (column * depth, row * depth, depth) [m]."""
        width, height = self.size
        focus = self.pixels_per_radian
        screen = np.array([[focus, 0, -width / 2], [0, -focus, -height / 2], [0, 0, -1.0]])
        return np.asarray(screen @ self.view[:3])

    @cached_property
    def light(self) -> Array:
        """The unit vector (3,) to a light above the left shoulder, which makes box faces differ."""
        right, _, back = self.view[:3, :3]
        return _normalize(np.array([0.0, 0.0, 1.0]) + 0.35 * back - 0.6 * right)

    def plane(self, frame: Array) -> Array:
        """Return the projection (3, 3) of points (x, y, 1) in the x-y plane of a frame (4, 4)."""
        return np.asarray(self.pixels @ frame[:, [0, 1, 3]])


def chase_camera(x: float, y: float, yaw: float, size: tuple[int, int]) -> Camera:
    """Return a camera behind and above a robot at x, y [m] with heading ``yaw`` [rad]."""
    forward, place = np.array([np.cos(yaw), np.sin(yaw), 0.0]), np.array([x, y, 0.0])
    eye = place - BACK_M * forward + [0.0, 0.0, UP_M]
    return Camera(eye, place + AHEAD_M * forward, np.eye(3)[2], CHASE_FOV_DEG, size)


def overhead_camera(low: ArrayLike, high: ArrayLike, size: tuple[int, int]) -> Camera:
    """Return a camera above a rectangle given by two corners (2,) [m]; x points right."""
    low, high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    (width, depth), (x, y) = high - low, (low + high) / 2.0
    shown = max(depth, width * size[1] / size[0])
    height = shown / 2.0 / np.tan(np.radians(OVERHEAD_FOV_DEG) / 2.0)
    eye, target = np.array([x, y, height]), np.array([x, y, 0.0])
    return Camera(eye, target, np.eye(3)[1], OVERHEAD_FOV_DEG, size)


def to_matrix(pose: Pose) -> Array:
    """Return a pose as a matrix (4, 4)."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = pose.rotation, pose.position
    return matrix


def _normalize(vector: Array) -> Array:
    return np.asarray(vector / np.linalg.norm(vector))


@dataclass(frozen=True)
@checked
class RenderOptions:
    """The options for a video or picture of a mission."""

    camera: Annotated[str, one_of(*CAMERAS)] = "chase"  # behind the robot, or above the course
    size: Annotated[tuple[int, int], SIZE] = (854, 480)  # width, height
    fps: Annotated[float, POSITIVE] = 25.0  # frames per second of video
    speed: Annotated[float, POSITIVE] = 10.0  # ratio of mission time to video time
    start_s: Annotated[float, NOT_NEGATIVE] = 0.0
    end_s: float = math.inf  # mission time [s], limited to the end of the mission
    title: str = ""

    def __post_init__(self) -> None:
        if not self.end_s > self.start_s:
            raise invalid(self, "end_s", self.end_s, "must be greater than start_s")


def sample_times(trajectory: pd.DataFrame, options: RenderOptions) -> Array:
    """Return the mission times (n,) [s] of the pictures; the last is the end time."""
    first, last = (float(trajectory["time_s"].iloc[row]) for row in (0, -1))
    start, end = max(options.start_s, first), min(options.end_s, last)
    if start > end:
        raise InputError(
            f"start_s: must be at most {last:g} s, the end of the mission, not "
            f"{options.start_s:g} s; start the video earlier"
        )
    step = options.speed / options.fps
    count = math.ceil((end - start) / step - 1e-9) + 1
    return np.asarray(np.minimum(start + step * np.arange(count), end))


def place_cameras(
    motion: Motion, world: World, places: Array, options: RenderOptions
) -> Iterator[Camera]:
    """Yield the camera for each picture; ``places`` (n, 2) [m] is the whole path of the robot."""
    if options.camera == "above":
        points = np.vstack([places, world.course.route(True)])
        margin = world.course.acceptance_m + _MARGIN_M
        low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
        yield from [overhead_camera(low, high, options.size)] * len(motion.time_s)
        return
    from scipy.ndimage import gaussian_filter1d  # slow to import

    sigma = _SMOOTHING_S * options.fps
    yaws = gaussian_filter1d(motion.yaw_rad, sigma, mode="nearest", radius=math.ceil(3 * sigma))
    for x, y, yaw in zip(motion.x_m, motion.y_m, yaws, strict=True):
        yield chase_camera(float(x), float(y), float(yaw), options.size)


def make_captions(
    mission: RecordedMission, motion: Motion, options: RenderOptions
) -> Iterator[Caption]:
    """Yield the caption for each picture, without sensor states."""
    trajectory, context = mission.trajectory, mission.context
    touches = any(signal.measures == CONTACT for signal in context.signals.values())
    near = "near, touched" if touches else "near"
    key = [(CLEAR, "clear"), (NEAR, near), (FAILED, "failed or silent")]
    if any(fault.kind != ENDS for fault in mission.faults):
        key.append((ERRING, "faulty (stronger colour: larger error)"))
    end, goals = float(trajectory["time_s"].iloc[-1]), len(mission.world.course.route(True))
    contacts = trajectory.get("contact", pd.Series(0, trajectory.index)).to_numpy() > 0
    modes = ("none", *context.modes)
    for time, row in zip(motion.time_s, motion.record, strict=True):
        visited, mode = int(trajectory["visited"].iloc[row]), int(trajectory["mode"].iloc[row])
        state = "collision" if contacts[row] else modes[mode] if mode < len(modes) else str(mode)
        goal = "completed" if visited == goals else f"waypoint {visited + 1} of {goals}"
        failed = ", ".join(part for part, at, _ in mission.part_failures if at <= time)
        state += f", failed: {failed}" * bool(failed)
        texts = (options.title, f"{time:.0f} s of {end:.0f} s", goal, state)
        yield Caption(texts, f"{options.speed:g} x real time", (), key)
