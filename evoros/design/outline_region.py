"""A side of any robot on whose surface a sensor may be placed, without a coordinate."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Annotated

import numpy as np

from evoros.base import elementary
from evoros.base.arrays import Array
from evoros.base.checks import NOT_NEGATIVE, TEXT, checked, one_of
from evoros.base.errors import InputError
from evoros.base.intervals import INTERVAL, Interval, bounds
from evoros.design.free_places import FreePlaces, find_free_places
from evoros.design.protocol import Area, Range, SensorPose, check_link
from evoros.design.region import ELEVATION, HEADING, check_height
from evoros.design.side import SIDES, SideLine, trace_side
from evoros.geometry.footprint import Footprint, convex_hull, distances
from evoros.robot.model import Robot
from evoros.robot.outline import SolidShape, compute_outline, compute_outline_at
from evoros.sensor.protocol import Sensor


@dataclass(frozen=True)
@checked
class OutlineRegion:
    """A side of the outline of the robot or of one of its links, at a height.

    The sensor lies on the outline of the collision shapes that reach the height, or of all of them
    if none does, and faces outwards.
    """

    side: Annotated[str, one_of(*SIDES)]
    yaw_deg: Annotated[Interval, HEADING] = 0.0  # from the outward normal, left positive
    height_m: Annotated[Interval | None, INTERVAL] = None  # above the ground; None: default mount
    pitch_deg: Annotated[Interval | None, ELEVATION] = None  # nose up positive; None: default mount
    link: Annotated[str | None, TEXT] = None  # None: the outline of the whole robot
    overhang_m: Annotated[float, NOT_NEGATIVE] = 0.05  # how far a sensor may stand out

    def bind(
        self, robot: Robot, mirrored: bool, key: str, sensors: Sequence[Sensor] = ()
    ) -> "BoundOutlineRegion":
        """Return this region on ``robot``.

        Raises:
            InputError: the link cannot carry sensors, the height is off the robot, or twins would
                stand out too far because the robot is not symmetric.
        """
        link = robot.mount_link if self.link is None else self.link
        self._check_link(link, robot, mirrored, key)
        default = self.height_m is None
        heights = bounds(self._default_height(robot, key) if default else self.height_m)
        check_height(robot, key, "height_m", heights, self.overhang_m)
        lines = tuple(
            (top, trace_side(self._outline(robot, middle, mirrored, key), self.side))
            for top, middle in _split(heights, _solids(robot, self.link))
        )
        pitch = robot.default_pitch(sensors) if self.pitch_deg is None else self.pitch_deg
        frame = robot.sensor_links[link]
        longest = max(line.length for _, line in lines)
        ranges = {
            "z_m": (heights[0] - frame[2], heights[1] - frame[2]),
            "arc": (0.0, 1.0 if longest > 0 else 0.0),
            "yaw_deg": bounds(self.yaw_deg),
            "pitch_deg": bounds(pitch),
        }
        whole = BoundOutlineRegion(link, ranges, frame, lines)
        free = find_free_places(robot, link, ranges, whole.place, sensors, mirrored)
        return replace(whole, free=free)

    def _check_link(self, link: str, robot: Robot, mirrored: bool, key: str) -> None:
        check_link(link, robot, mirrored, key)
        if self.link is not None and not _solids(robot, link):
            known = dict.fromkeys(solid.link for solid in robot.solids)
            choices = [name for name in known if name in robot.sensor_links]
            raise InputError(
                f"{key}.link: must have a collision shape, whose outline carries the sensors, not "
                f"{link!r}; choose {' or '.join(choices) or 'null'}, or leave it null"
            )

    def _default_height(self, robot: Robot, key: str) -> float:
        if self.link is not None and self.link != robot.mount_link:
            raise InputError(
                f"{key}.height_m: must be a height on the link {self.link}, not null; set it, "
                f"because the robot's default height is for {robot.mount_link}"
            )
        return robot.sensor_links[robot.mount_link][2] + robot.mount_z_m

    def _outline(self, robot: Robot, height: float, mirrored: bool, key: str) -> Array:
        """Return the outline at a height; with its mirror image if sensors have twins."""
        solids = _solids(robot, self.link)
        outline = compute_outline_at(solids, height)
        if outline is None:
            pairs = ((solid.shape, solid.pose) for solid in solids)
            outline = compute_outline(pairs) if solids else robot.outline
        if not mirrored:
            return outline
        both = convex_hull(np.concatenate([outline, outline * (1.0, -1.0)]))
        gap = float(distances(Footprint(outline), both).max())
        if gap > self.overhang_m:
            raise InputError(
                f"{key}: the outline of {robot.name} must be symmetric to {self.overhang_m:g} m if "
                f"sensors are mirrored, but differs by {gap:.3g} m; set mirrored to false, or "
                f"raise its overhang_m"
            )
        return both


@dataclass(frozen=True)
class BoundOutlineRegion:
    """A side on its robot."""

    link: str
    ranges: Mapping[str, Range]
    frame: tuple[float, float, float, float]  # of the link: x, y, z [m], yaw [rad]
    lines: tuple[tuple[float, SideLine], ...]  # each after its maximum height above the ground [m]
    free: FreePlaces | None = None  # None: all places

    def place(self, values: Mapping[str, float]) -> SensorPose:
        """Return the pose at a share of the way along the side, from right to left.

        If places are left out, it is at the same share of the free ones.
        """
        if self.free is not None:
            values = self.free.adapt(values)
        line = self._line(values["z_m"] + self.frame[2])
        (x, y), normal = line.at(values["arc"])
        x0, y0, _, yaw = self.frame
        sin, cos = elementary.sin_cos(yaw)
        dx, dy = x - x0, y - y0
        heading = normal - math.degrees(yaw) + values["yaw_deg"]
        position = (cos * dx + sin * dy, cos * dy - sin * dx, values["z_m"])
        return SensorPose(position, heading, values["pitch_deg"])

    def _line(self, height: float) -> SideLine:
        return next((line for top, line in self.lines if height <= top), self.lines[-1][1])

    def area(self) -> Area:
        """Return the line at the lowest height."""
        line, (low, high) = self.lines[0][1], self.ranges["yaw_deg"]
        facing = tuple((normal + low, normal + high) for normal in line.normals_deg)
        headings, angles = (facing[0][0], facing[-1][1]), self.ranges["pitch_deg"]
        return Area(self.link, line.corners, headings, self.ranges["z_m"], angles, facing)


def _solids(robot: Robot, link: str | None) -> list[SolidShape]:
    return [solid for solid in robot.solids if link in (None, solid.link)]


def _split(heights: Range, solids: Sequence[SolidShape]) -> list[tuple[float, float]]:
    """Return the top and the middle [m] of each band of heights with the same shapes."""
    low, high = heights
    ends = {end for solid in solids for end in solid.height_range if low < end < high}
    edges = [low, *sorted(ends), high]
    return [(above, 0.5 * (below + above)) for below, above in pairwise(edges)]
