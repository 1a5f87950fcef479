"""A box of a robot in which a sensor may be placed, and the angles it may have."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated

from evoros.base import elementary
from evoros.base.checks import NOT_NEGATIVE, TEXT, Rule, checked
from evoros.base.errors import InputError
from evoros.base.intervals import INTERVAL, Interval, bounds
from evoros.design.free_places import FreePlaces, find_free_places
from evoros.design.protocol import ANGLES, Area, Range, SensorPose, check_link
from evoros.robot.model import Robot
from evoros.sensor.protocol import Sensor

COORDINATES = ("x_m", "y_m", "z_m")


def _within(limit: float, text: str) -> Rule:
    def holds(value: object) -> bool:
        return INTERVAL.holds(value) and all(abs(end) <= limit for end in bounds(value))

    return Rule(f"{INTERVAL.text}, {text}", holds)


HEADING = _within(360, "from -360 to 360")
ELEVATION = _within(90, "from -90 to 90")


@dataclass(frozen=True)
@checked
class Region:
    """Position and angles that a sensor may have, each a number or [low, high]."""

    x_m: Annotated[Interval, INTERVAL]  # in the frame of ``link``
    y_m: Annotated[Interval, INTERVAL]
    yaw_deg: Annotated[Interval, HEADING]  # left positive
    z_m: Annotated[Interval | None, INTERVAL] = None  # None: as high as the default mount
    pitch_deg: Annotated[Interval | None, ELEVATION] = None  # nose up positive; None: see z_m
    link: Annotated[str | None, TEXT] = None  # None: the link of the robot's default mount
    overhang_m: Annotated[float, NOT_NEGATIVE] = 0.05  # how far a bracket may stand out

    def bind(
        self, robot: Robot, mirrored: bool, key: str, sensors: Sequence[Sensor] = ()
    ) -> "BoundRegion":
        """Return this region on ``robot``, whose default mount has the values that are None."""
        link = robot.mount_link if self.link is None else self.link
        self._check_link(link, robot, mirrored, key)
        bound = replace(
            self,
            z_m=robot.mount_z_m if self.z_m is None else self.z_m,
            pitch_deg=robot.default_pitch(sensors) if self.pitch_deg is None else self.pitch_deg,
            link=link,
        )
        bound._check_outline(link, robot, mirrored, key)
        bound._check_height(link, robot, key)
        ranges = {name: bounds(getattr(bound, name)) for name in (*COORDINATES, *ANGLES)}
        x, y, _, yaw = robot.sensor_links[link]
        whole = BoundRegion(link, ranges, (x, y, yaw))
        free = find_free_places(robot, link, ranges, whole.place, sensors, mirrored)
        return replace(whole, free=free)

    def _check_link(self, link: str, robot: Robot, mirrored: bool, key: str) -> None:
        check_link(link, robot, mirrored, key)
        if self.z_m is None and link != robot.mount_link:
            raise InputError(
                f"{key}.z_m: must be a number on the link {link}, not null; "
                f"set it, because the robot's default height is for {robot.mount_link}"
            )

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
                    f"{key}: {'xy'[axis]} must be at most {self.overhang_m} m outside the outline "
                    f"of {robot.name} ({minimum:g} to {maximum:g} m), not {low:g} to {high:g} m; "
                    f"choose design=around, which fits any robot, move the region, or raise "
                    f"its overhang_m"
                )

    def _check_height(self, link: str, robot: Robot, key: str) -> None:
        base = robot.sensor_links[link][2]
        low, high = (base + end for end in bounds(self.z_m))
        check_height(robot, key, "z", (low, high), self.overhang_m, base)


def check_height(
    robot: Robot, key: str, name: str, heights: Range, overhang: float, base: float = 0.0
) -> None:
    """Require heights [m] above the ground that the robot, or a link at ``base`` [m], has."""
    low, high = heights
    # Parts without a collision shape may be higher, such as a mast or the default mount.
    mount = robot.sensor_links[robot.mount_link][2] + robot.mount_z_m
    top = max(robot.height_m, base, mount)
    if low < 0 or high > top + overhang:
        raise InputError(
            f"{key}: {name} must be above the ground and at most {overhang} m above "
            f"{robot.name} ({top:g} m), not {low:g} to {high:g} m; "
            f"choose design=around, which fits any robot, move the region, or raise its overhang_m"
        )


@dataclass(frozen=True)
class BoundRegion:
    """A box on its robot."""

    link: str
    ranges: Mapping[str, Range]
    frame: tuple[float, float, float]  # of the link: x, y [m], yaw [rad] in the robot's frame
    free: FreePlaces | None = None  # None: all places

    def place(self, values: Mapping[str, float]) -> SensorPose:
        """Return the pose with these values, which are the coordinates and angles themselves.

        If places are left out, it is at the same share of the free ones.
        """
        if self.free is not None:
            values = self.free.adapt(values)
        x, y, z, yaw, pitch = (values[name] for name in (*COORDINATES, *ANGLES))
        return SensorPose((x, y, z), yaw, pitch)

    def area(self) -> Area:
        """Return the rectangle of the box from above."""
        x, y, yaw = self.frame
        (a, b), (c, d) = self.ranges["x_m"], self.ranges["y_m"]
        sin, cos = elementary.sin_cos(yaw)
        corners = tuple(
            (x + cos * p - sin * q, y + sin * p + cos * q)
            for p, q in ((a, c), (b, c), (b, d), (a, d))
        )
        low, high = (end + math.degrees(yaw) for end in self.ranges["yaw_deg"])
        return Area(self.link, corners, (low, high), self.ranges["z_m"], self.ranges["pitch_deg"])
