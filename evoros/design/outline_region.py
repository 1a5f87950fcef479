"""A region along a side of a robot's outline, which needs no coordinates and fits any robot."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Annotated

import numpy as np

from evoros.base import elementary
from evoros.base.arrays import Array, product
from evoros.base.checks import INTERVAL, NOT_NEGATIVE, TEXT, Interval, bounds, checked, one_of
from evoros.base.errors import InputError
from evoros.design import protocol
from evoros.design.region import ELEVATION, HEADING, FreePlaces, check_height, find_free_places
from evoros.geometry.footprint import Footprint, convex_hull, distances
from evoros.robot.model import Robot
from evoros.robot.outline import SolidShape, compute_outline, compute_outline_at
from evoros.sensor.protocol import Sensor

SIDES = {"front": 0.0, "left": 90.0, "rear": 180.0, "right": -90.0, "all_around": 0.0}
"""The direction [deg] of each side, left positive."""
_HALF_SECTOR_DEG = 45.0
_ROUNDING_DEG = 1e-6


@dataclass(frozen=True)
class SideLine:
    """A polyline along an outline, counter-clockwise, possibly a single corner."""

    corners: tuple[protocol.Point, ...]  # [m]
    normals_deg: tuple[float, ...]  # outward normal of each segment or of the single corner

    @property
    def lengths(self) -> list[float]:
        """The length [m] of each segment."""
        return [math.dist(a, b) for a, b in pairwise(self.corners)]

    def at(self, share: float) -> tuple[protocol.Point, float]:
        """Return the point at a fraction of the length, and the outward normal [deg] there."""
        rest = share * math.fsum(self.lengths)
        for i, length in enumerate(self.lengths):
            if rest <= length:
                (ax, ay), (bx, by) = self.corners[i], self.corners[i + 1]
                part = rest / length
                return (ax + part * (bx - ax), ay + part * (by - ay)), self.normals_deg[i]
            rest -= length
        return self.corners[-1], self.normals_deg[-1]


def trace_side(outline: Array, side: str) -> SideLine:
    """Return the edges of an outline (k, 2) [m] that face a side, from right to left.

    An edge faces a side if its outward normal is within 45 deg of the direction of the side.
    Without such edges, the result is the farthest corner in that direction. The outline is convex
    and counter-clockwise.
    """
    direction = SIDES[side]
    reach = 180.0 if side == "all_around" else _HALF_SECTOR_DEG
    after = np.roll(outline, -1, axis=0)
    edges = []
    for a, b in zip(outline.tolist(), after.tolist(), strict=True):
        if a == b:
            continue
        normal = math.degrees(elementary.atan2(a[0] - b[0], b[1] - a[1]))
        turn = normal - direction
        turn -= 360.0 * math.ceil((turn - 180.0) / 360.0)
        if abs(turn) <= reach + _ROUNDING_DEG:
            edges.append((turn, a, b))
    if not edges:
        radians = math.radians(direction)
        farthest = product(outline, np.array([elementary.cos(radians), elementary.sin(radians)]))
        x, y = outline[int(np.argmax(farthest))].tolist()
        return SideLine(((x, y),), (direction,))
    edges.sort(key=lambda edge: edge[0])
    corners = [edges[0][1], *(b for _, _, b in edges)]
    normals = tuple(direction + turn for turn, _, _ in edges)  # ascending
    return SideLine(tuple((x, y) for x, y in corners), normals)


@dataclass(frozen=True)
@checked
class OutlineRegion(protocol.RegionDescription):
    """A side of the outline of a robot, or of one of its links, at a height.

    The outline of all shapes is used if no shape reaches that height. Sensors face outwards.
    """

    side: Annotated[str, one_of(*SIDES)]
    yaw_deg: Annotated[Interval, HEADING] = 0.0  # relative to the outward normal, left positive
    height_m: Annotated[Interval | None, INTERVAL] = None  # above ground; None: the default mount's
    pitch_deg: Annotated[Interval | None, ELEVATION] = None  # nose-up; None: the default mount's
    link: Annotated[str | None, TEXT] = None  # None: outline of the whole robot
    overhang_m: Annotated[float, NOT_NEGATIVE] = 0.05  # maximum distance outside the outline

    def bind(
        self, robot: Robot, mirrored: bool, key: str, sensors: Sequence[Sensor] = ()
    ) -> "BoundOutlineRegion":
        """Return this region bound to ``robot``, which must be symmetric if ``mirrored``."""
        link = robot.mount_link if self.link is None else self.link
        self._check_link(link, robot, mirrored, key)
        height = self.height_m
        if height is None:
            protocol.require_height(link, robot, f"{key}.height_m")
            height = robot.sensor_links[link][2] + robot.mount_z_m
        heights = bounds(height)
        check_height(robot, key, "height_m", heights, self.overhang_m)
        lines = tuple(
            (top, trace_side(self._outline(robot, middle, mirrored, key), self.side))
            for top, middle in _split(heights, _solids(robot, self.link))
        )
        pitch = robot.default_pitch(sensors) if self.pitch_deg is None else self.pitch_deg
        frame = robot.sensor_links[link]
        ranges = {
            "z_m": (heights[0] - frame[2], heights[1] - frame[2]),
            "arc": (0.0, 1.0 if any(any(line.lengths) for _, line in lines) else 0.0),
            "yaw_deg": bounds(self.yaw_deg),
            "pitch_deg": bounds(pitch),
        }
        whole = BoundOutlineRegion(link, ranges, frame, lines)
        free = find_free_places(robot, link, ranges, whole.place, sensors, mirrored)
        return replace(whole, free=free)

    def _check_link(self, link: str, robot: Robot, mirrored: bool, key: str) -> None:
        protocol.check_link(link, robot, mirrored, key)
        if self.link is not None and not _solids(robot, link):
            known = dict.fromkeys(solid.link for solid in robot.solids)
            choices = [name for name in known if name in robot.sensor_links]
            raise InputError(
                f"{key}.link: must be a link with a collision shape, not {link!r}, because "
                f"sensors lie on its outline; choose {' or '.join([*choices, 'null'])}"
            )

    def _outline(self, robot: Robot, height: float, mirrored: bool, key: str) -> Array:
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
                f"{key}: the outline of {robot.name} must be symmetric to within "
                f"{self.overhang_m:g} m if sensors are mirrored, but its sides differ by {gap:.3g} "
                "m; set mirrored to false, or raise overhang_m"
            )
        return both


@dataclass(frozen=True)
class BoundOutlineRegion:
    """An outline region bound to a robot."""

    link: str
    ranges: Mapping[str, protocol.Range]
    frame: tuple[float, float, float, float]  # x, y, z [m] and yaw [rad] of the link's frame
    lines: tuple[tuple[float, SideLine], ...]  # (maximum height above the ground [m], line)
    free: FreePlaces | None = None  # None if all places are free

    def place(self, values: Mapping[str, float]) -> protocol.SensorPose:
        """Return the pose at a fraction of the side's free length, from right to left."""
        if self.free is not None:
            values = self.free.adapt(values)
        height = values["z_m"] + self.frame[2]
        line = next((line for top, line in self.lines if height <= top), self.lines[-1][1])
        (x, y), normal = line.at(values["arc"])
        x0, y0, _, yaw = self.frame
        sin, cos = elementary.sin_cos(yaw)
        dx, dy = x - x0, y - y0
        heading = normal - math.degrees(yaw) + values["yaw_deg"]
        position = (cos * dx + sin * dy, cos * dy - sin * dx, values["z_m"])
        return protocol.SensorPose(position, heading, values["pitch_deg"])

    def area(self) -> protocol.Area:
        """Return the line in the lowest height band, for drawing."""
        line, (low, high) = self.lines[0][1], self.ranges["yaw_deg"]
        facing = tuple((normal + low, normal + high) for normal in line.normals_deg)
        headings, angles = (facing[0][0], facing[-1][1]), self.ranges["pitch_deg"]
        return protocol.Area(self.link, line.corners, headings, self.ranges["z_m"], angles, facing)


def _solids(robot: Robot, link: str | None) -> list[SolidShape]:
    return [solid for solid in robot.solids if link in (None, solid.link)]


def _split(heights: protocol.Range, solids: Sequence[SolidShape]) -> list[tuple[float, float]]:
    """Return (top, middle) [m] of each height band in which no shape starts or ends."""
    low, high = heights
    ends = {end for solid in solids for end in solid.height_range if low < end < high}
    edges = [low, *sorted(ends), high]
    return [(above, 0.5 * (below + above)) for below, above in pairwise(edges)]
