"""The places and headings of a region at which the robot does not hide the view of a sensor."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from evoros.design.protocol import Range, SensorPose
from evoros.robot.frames import make_frames, place_on_links
from evoros.robot.model import Robot
from evoros.robot.self_sight import find_blind_shares
from evoros.sensor.protocol import Sensor, sees

CELLS = {"z_m": 2, "x_m": 12, "y_m": 12, "arc": 32, "yaw_deg": 8, "pitch_deg": 2}
"""The number of cells into which the range of each value is divided, in the order of the axes."""

MAX_BLIND = 0.5
"""The share of a sensor's channels that the robot may hide; one ray hides a sonar's only one."""

_MIRRORED = (1.0, -1.0, 1.0, -1.0, 1.0)
"""Factors of a pose (x, y, z, yaw, pitch) whose product is that of its twin."""


@dataclass(frozen=True)
class FreePlaces:
    """The cells of a region whose sensors see past the robot, as a grid over its values.

    Values are mapped to free cells one axis after another, each by its share of the cells that are
    free behind the cells chosen before. So every genome leads to a free place, and all free cells
    are equally large for a search.
    """

    ranges: Mapping[str, Range]  # of the axes, in the order of the grid
    free: NDArray[np.bool_]

    def adapt(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return values in free cells for values anywhere in the region."""
        adapted, free = dict(values), self.free
        for name, (low, high) in self.ranges.items():
            others = tuple(range(1, free.ndim))
            cells = np.flatnonzero(free.any(axis=others))
            share = (values[name] - low) / (high - low) * len(cells)
            index = min(int(share), len(cells) - 1)
            cell = int(cells[index])
            adapted[name] = low + (cell + share - index) / len(free) * (high - low)
            free = free[cell]
        return adapted


def find_free_places(
    robot: Robot,
    link: str,
    ranges: Mapping[str, Range],
    place: Callable[[Mapping[str, float]], SensorPose],
    sensors: Sequence[Sensor],
    mirrored: bool,
) -> FreePlaces | None:
    """Find the cells in which the robot hides none of ``sensors``, nor their mirrored twins.

    Returns:
        None if all cells are free, or none is, so that nothing can be left out.
    """
    types = [sensor for sensor in sensors if sees(sensor)]
    axes = {name: ranges[name] for name in CELLS if np.ptp(ranges.get(name, (0.0, 0.0))) > 0.0}
    if not types or not axes or not robot.occluders.shapes:
        return None
    poses = np.array([_flatten(place({**_middle(ranges), **at})) for at in _list_corners(axes)])
    sides = (poses, poses * _MIRRORED) if mirrored else (poses,)
    frames = [make_frames(place_on_links(np.array(robot.sensor_links[link]), p)) for p in sides]
    free = np.ones(len(poses), dtype=np.bool_)
    for sensor, side in product(types, frames):
        free &= find_blind_shares(robot, sensor, side) < MAX_BLIND
    cells = _join_corners(free.reshape([CELLS[name] + 1 for name in axes]))
    return None if cells.all() or not cells.any() else FreePlaces(axes, cells)


def _join_corners(free: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which cells have all of their corners free."""
    for axis in range(free.ndim):
        corners = free.swapaxes(0, axis)
        free = (corners[1:] & corners[:-1]).swapaxes(0, axis)
    return free


def _middle(ranges: Mapping[str, Range]) -> dict[str, float]:
    return {name: 0.5 * (low + high) for name, (low, high) in ranges.items()}


def _list_corners(axes: Mapping[str, Range]) -> Iterator[dict[str, float]]:
    """Yield the values at the corners of the cells, the last axis fastest."""
    corners = [np.linspace(*ends, CELLS[name] + 1).tolist() for name, ends in axes.items()]
    for values in product(*corners):
        yield dict(zip(axes, values, strict=True))


def _flatten(pose: SensorPose) -> tuple[float, ...]:
    return (*pose.position, pose.yaw_deg, pose.pitch_deg)
