"""A box in which a sensor may be placed, and its cells in which the robot blocks no view."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from evoros.base import elementary
from evoros.base.arrays import Array
from evoros.base.checks import INTERVAL, NOT_NEGATIVE, TEXT, Interval, Rule, bounds, checked
from evoros.base.errors import InputError
from evoros.design import protocol
from evoros.robot.model import Robot
from evoros.robot.mounting import make_frames, place_on_links
from evoros.robot.self_sight import BlindShares
from evoros.sensor.protocol import Sensor, sees

CELLS = {"z_m": 2, "x_m": 12, "y_m": 12, "arc": 32, "yaw_deg": 8, "pitch_deg": 2}
"""Number of grid cells for the range of each value, in the order of the grid axes."""
_MAX_BLIND = 0.5  # maximum fraction of a sensor's channels that the robot may block
_MIRRORED = (1.0, -1.0, 1.0, -1.0, 1.0)  # factors that mirror a pose (x, y, z, yaw, pitch)


@dataclass(frozen=True)
class View:
    """Tests whether the robot blocks the view of sensors at places in a region."""

    frame: Array  # x, y, z [m] and yaw [rad] of the link
    place: Callable[[Mapping[str, float]], protocol.SensorPose]
    sensors: Sequence[BlindShares]
    mirrored: bool  # whether the mirror image of a place must be free as well

    def find_free(self, places: Iterable[Mapping[str, float]]) -> NDArray[np.bool_]:
        """Return a mask of the places at which the robot blocks no sensor's view."""
        placed = map(self.place, places)
        poses = np.array([(*position, yaw, pitch) for position, yaw, pitch in placed])
        sides = (poses, poses * _MIRRORED) if self.mirrored else (poses,)
        frames = [make_frames(place_on_links(self.frame, side)) for side in sides]
        shares = [sensor.find(side) for sensor, side in product(self.sensors, frames)]
        return np.asarray(np.max(shares, axis=0) < _MAX_BLIND)


@dataclass(frozen=True)
class FreePlaces:
    """A grid over the values of a region, with a mask of cells in which the robot blocks no view.

    Values are mapped to free cells axis by axis, in proportion to the remaining cells, so every
    genome leads to a free place, and free cells have equal shares.
    """

    ranges: Mapping[str, protocol.Range]  # range of each value, in the order of the grid axes
    free: NDArray[np.bool_]
    view: View

    def adapt(self, values: Mapping[str, float]) -> dict[str, float]:
        """Map values anywhere in the region to values in free cells."""
        adapted, corner, free = dict(values), {}, self.free
        for name, (low, high) in self.ranges.items():
            others = tuple(range(1, free.ndim))
            cells = np.flatnonzero(free.any(axis=others))
            share = (values[name] - low) / (high - low) * len(cells)
            index = min(int(share), len(cells) - 1)
            cell = int(cells[index])
            adapted[name] = low + (cell + share - index) / len(free) * (high - low)
            corner[name] = cell + round(share - index)
            free = free[cell]
        if self.view.find_free([adapted])[0]:
            return adapted
        # A part smaller than a cell blocks the view, so use the nearest corner of the cell.
        ends = (
            _list_ends(self.ranges[name], cells)
            for name, cells in zip(corner, self.free.shape, strict=True)
        )
        return adapted | {name: end[corner[name]] for name, end in zip(corner, ends, strict=True)}


def find_free_places(
    robot: Robot,
    link: str,
    ranges: Mapping[str, protocol.Range],
    place: Callable[[Mapping[str, float]], protocol.SensorPose],
    sensors: Sequence[Sensor],
    mirrored: bool,
) -> FreePlaces | None:
    """Find the cells in which the robot blocks no sensor; None if all are free, or none is."""
    types = [sensor for sensor in sensors if sees(sensor)]
    axes = {name: ranges[name] for name in CELLS if np.ptp(ranges.get(name, (0.0, 0.0))) > 0.0}
    if not types or not axes or not robot.occluders.shapes:
        return None
    middle = {name: 0.5 * (low + high) for name, (low, high) in ranges.items()}
    shares = [BlindShares(robot, sensor) for sensor in types]
    view = View(np.array(robot.sensor_links[link]), place, shares, mirrored)
    free = view.find_free({**middle, **at} for at in _list_corners(axes))
    cells = free.reshape([CELLS[name] + 1 for name in axes])
    for axis in range(cells.ndim):  # a cell is free if all its corners are
        corners = cells.swapaxes(0, axis)
        cells = (corners[1:] & corners[:-1]).swapaxes(0, axis)
    return None if cells.all() or not cells.any() else FreePlaces(axes, cells, view)


def _list_corners(axes: Mapping[str, protocol.Range]) -> Iterator[dict[str, float]]:
    corners = [_list_ends(ends, CELLS[name]) for name, ends in axes.items()]
    for values in product(*corners):
        yield dict(zip(axes, values, strict=True))


def _list_ends(ends: protocol.Range, cells: int) -> list[float]:
    return list(np.linspace(*ends, cells + 1).tolist())


COORDINATES = ("x_m", "y_m", "z_m")


def _within(limit: float, text: str) -> Rule:
    def holds(value: object) -> bool:
        return INTERVAL.holds(value) and all(abs(end) <= limit for end in bounds(value))

    return Rule(f"{INTERVAL.text}, {text}", holds)


HEADING = _within(360, "from -360 to 360")
ELEVATION = _within(90, "from -90 to 90")


@dataclass(frozen=True)
@checked
class Region(protocol.RegionDescription):
    """The possible position and angles of a sensor, each a number or [low, high]."""

    x_m: Annotated[Interval, INTERVAL]  # x and y are in the frame of ``link``
    y_m: Annotated[Interval, INTERVAL]
    yaw_deg: Annotated[Interval, HEADING]  # positive to the left
    z_m: Annotated[Interval | None, INTERVAL] = None  # None: height of the default mount
    pitch_deg: Annotated[Interval | None, ELEVATION] = None  # nose-up; None: the default mount's
    link: Annotated[str | None, TEXT] = None  # None: link of the default mount
    overhang_m: Annotated[float, NOT_NEGATIVE] = 0.05  # maximum distance outside the outline

    def bind(
        self, robot: Robot, mirrored: bool, key: str, sensors: Sequence[Sensor] = ()
    ) -> "BoundRegion":
        """Return this region bound to ``robot``; the default mount provides missing values."""
        link = robot.mount_link if self.link is None else self.link
        protocol.check_link(link, robot, mirrored, key)
        if self.z_m is None:
            protocol.require_height(link, robot, f"{key}.z_m")
        bound = replace(
            self,
            z_m=robot.mount_z_m if self.z_m is None else self.z_m,
            pitch_deg=robot.default_pitch(sensors) if self.pitch_deg is None else self.pitch_deg,
            link=link,
        )
        bound._check_outline(link, robot, mirrored, key)
        ranges = {name: bounds(getattr(bound, name)) for name in (*COORDINATES, *protocol.ANGLES)}
        x, y, base, yaw = robot.sensor_links[link]
        low, high = ranges["z_m"]
        check_height(robot, key, "z", (base + low, base + high), self.overhang_m, base)
        whole = BoundRegion(link, ranges, (x, y, yaw))
        free = find_free_places(robot, link, ranges, whole.place, sensors, mirrored)
        return replace(whole, free=free)

    def _check_outline(self, link: str, robot: Robot, mirrored: bool, key: str) -> None:
        x, y, _, yaw = robot.sensor_links[link]
        sides = (1, -1) if mirrored else (1,)
        corners = [
            (a, side * b) for a in bounds(self.x_m) for b in bounds(self.y_m) for side in sides
        ]
        sin, cos = elementary.sin_cos(yaw)
        in_frame = [(x + cos * a - sin * b, y + sin * a + cos * b) for a, b in corners]
        ranges = zip(robot.outline.min(axis=0), robot.outline.max(axis=0), strict=True)
        for axis, (minimum, maximum) in enumerate(ranges):
            low, high = (end([corner[axis] for corner in in_frame]) for end in (min, max))
            if low < minimum - self.overhang_m or high > maximum + self.overhang_m:
                raise InputError(
                    f"{key}: {'xy'[axis]} extends from {low:g} to {high:g} m, more than "
                    f"{self.overhang_m} m outside the outline of {robot.name} ({minimum:g} to "
                    f"{maximum:g} m); choose design=around, which fits any robot, move the region, "
                    "or raise overhang_m"
                )


def check_height(
    robot: Robot, key: str, name: str, heights: protocol.Range, overhang: float, base: float = 0.0
) -> None:
    """Raise an InputError if heights [m] above the ground are off the robot or its ``base``."""
    low, high = heights
    # Parts without collision shapes, such as a mast or the default mount, may be higher.
    mount = robot.sensor_links[robot.mount_link][2] + robot.mount_z_m
    top = max(robot.height_m, base, mount)
    if low < 0 or high > top + overhang:
        raise InputError(
            f"{key}: {name} must be above the ground and at most {overhang} m above "
            f"{robot.name} ({top:g} m), not {low:g} to {high:g} m; "
            f"move the region, raise overhang_m, or choose design=around, which fits any robot"
        )


@dataclass(frozen=True)
class BoundRegion:
    """A box region bound to a robot."""

    link: str
    ranges: Mapping[str, protocol.Range]
    frame: tuple[float, float, float]  # x, y [m] and yaw [rad] of the link in the robot's frame
    free: FreePlaces | None = None  # None if all places are free

    def place(self, values: Mapping[str, float]) -> protocol.SensorPose:
        """Return the pose with the given coordinates and angles."""
        if self.free is not None:
            values = self.free.adapt(values)
        x, y, z, yaw, pitch = (values[name] for name in (*COORDINATES, *protocol.ANGLES))
        return protocol.SensorPose((x, y, z), yaw, pitch)

    def area(self) -> protocol.Area:
        """Return the rectangle of the box in top view."""
        x, y, yaw = self.frame
        (a, b), (c, d) = self.ranges["x_m"], self.ranges["y_m"]
        sin, cos = elementary.sin_cos(yaw)
        corners = tuple(
            (x + cos * p - sin * q, y + sin * p + cos * q)
            for p, q in ((a, c), (b, c), (b, d), (a, d))
        )
        low, high = (end + math.degrees(yaw) for end in self.ranges["yaw_deg"])
        return protocol.Area(
            self.link, corners, (low, high), self.ranges["z_m"], self.ranges["pitch_deg"]
        )
