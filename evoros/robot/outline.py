"""The shapes of a robot's links, and their outlines as convex polygons in top view."""

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from evoros.base import elementary
from evoros.base.arrays import Array
from evoros.compilation.elementary_arrays import cos_all, sin_all
from evoros.drive.protocol import Drive
from evoros.formats.urdf.tree import Urdf
from evoros.geometry.footprint import Footprint, convex_hull, distances, find_heights, project_shape
from evoros.geometry.ray import AT_X, AT_Y, BOUND, place_obstacle
from evoros.geometry.shapes import Pose, Shape
from evoros.world.standing import sight_rows

_CIRCLE_CORNERS = 64  # number of corners of the polygon around a circle
_OVERHANG_M = 1e-3  # overhang [m] up to which a wheel counts as covered by the body


@dataclass(frozen=True)
class SolidShape:
    """A shape of a link; ``pose`` is in the robot's frame with the wheels straight ahead."""

    link: str
    shape: Shape
    pose: Pose
    rolls: bool = False  # whether the shape belongs to a wheel or caster

    @property
    def height_range(self) -> tuple[float, float]:
        """The heights [m] of the lowest and the highest point."""
        return find_heights(self.shape, self.pose)


def compute_outline(solids: Iterable[tuple[Shape, Pose]]) -> Array:
    """Return the convex hull (k, 2) [m] of shapes in top view; circles become polygons."""
    turn = np.arange(_CIRCLE_CORNERS) * (2.0 * math.pi / _CIRCLE_CORNERS)
    inner = elementary.cos(math.pi / _CIRCLE_CORNERS)
    disc = np.stack([cos_all(turn), sin_all(turn)], axis=1) / inner
    corners = []
    for shape, pose in solids:
        footprint = project_shape(shape, pose)
        reach = footprint.radius * disc if footprint.radius > 0 else np.zeros((1, 2))
        corners.append((footprint.vertices[:, None] + reach[None]).reshape(-1, 2))
    return convex_hull(np.concatenate(corners))


def compute_outline_at(solids: Sequence[SolidShape], height: float) -> Array | None:
    """Return the outline (k, 2) [m] of the shapes that reach a height [m]; None if none does."""
    ranges = [solid.height_range for solid in solids]
    reaching = [
        (solid.shape, solid.pose)
        for solid, (low, high) in zip(solids, ranges, strict=True)
        if low <= height <= high
    ]
    return compute_outline(reaching) if reaching else None


def rolling_shapes(urdf: Urdf, link: str) -> list[tuple[Shape, Pose]]:
    """Return a rolling link's shapes in the robot's frame; visual cylinders replace its spheres."""
    shapes, shown = urdf.shapes[link], urdf.visuals[link]
    balls = [shape for shape in shapes if shape.kind == "sphere"]
    discs = [shape for shape in shown if shape.kind == "cylinder"]
    if balls and len(balls) == len(shapes) and discs:
        shapes = tuple(discs)
    return [(shape, urdf.poses[link] @ shape.pose) for shape in shapes]


def find_exposed(urdf: Urdf, rolling: Collection[str], outline: Array) -> frozenset[str]:
    """Return the wheels and casters that extend beyond an outline (k, 2) [m]."""
    corners = {link: compute_outline(rolling_shapes(urdf, link)) for link in rolling}
    reach = {link: distances(Footprint(outline), places) for link, places in corners.items()}
    return frozenset(link for link, gaps in reach.items() if gaps.max() > _OVERHANG_M)


SWEEP = 17  # number of steering angles, from lock to lock, at which checks test steered wheels
BURIED_M = 0.1  # [m], path up to which a shape does not block a ray that starts in it


class Steering(NamedTuple):
    """The steering joint that rotates a shape."""

    joint: int  # index in drive.steering_joints
    pivot: tuple[float, float]  # x, y [m] of the joint's vertical axis in the robot's frame


@dataclass(frozen=True)
class Occluder(SolidShape):
    """A shape of a robot that can block the view of the robot's sensors."""

    steering: Steering | None = None


class OccluderRows(NamedTuple):
    """Shapes as rows for ray casting, in the robot's frame."""

    rows: Array  # (s, OBSTACLE_SIZE), as in evoros.geometry.ray
    faces: Array  # (f, FACE_SIZE), of all polyhedra
    inside: Array  # (s,) [m], path up to which a shape does not block a ray that starts in it
    rolls: Array  # (s,) 1 for wheels and casters, else 0
    numbers: Array  # (s,) index in Occluders.shapes
    heights: Array  # (s, 2) [m], heights of the lowest and the highest point


@dataclass(frozen=True, eq=False)
class Occluders:
    """All shapes of a robot that can block the view of its sensors."""

    shapes: tuple[Occluder, ...] = ()

    @cached_property
    def fixed(self) -> OccluderRows:
        """The unsteered shapes; a ray passes through a body shape in which it starts."""
        return self._select(False, np.inf)

    @cached_property
    def steered(self) -> OccluderRows:
        """The steered shapes, with the wheels straight ahead."""
        return self._select(True, np.inf)

    @cached_property
    def sweep_volumes(self) -> list[OccluderRows]:
        """An upright cylinder for each steered shape that contains it at all steering angles."""
        volumes = []
        for row, index in zip(self.steered.rows, self.steered.numbers, strict=True):
            pivot = self.steering_of(int(index)).pivot
            x, y = relative_row(row, pivot)[[AT_X, AT_Y]].tolist()
            low, high = self.shapes[int(index)].height_range
            cylinder = Shape("cylinder", (math.sqrt(x * x + y * y) + row[BOUND], high - low))
            rows, faces, _ = sight_rows([(cylinder, Pose((*pivot, 0.5 * (low + high))))])
            heights, zero = np.array([[low, high]]), np.zeros(1)
            volumes.append(OccluderRows(rows, faces, zero, np.ones(1), zero, heights))
        return volumes

    def sweep(self, drive: Drive) -> OccluderRows:
        """Return all shapes for checks, steered shapes at ``SWEEP`` angles from lock to lock."""
        parts, faces = [self._select(False, BURIED_M)], self._arrays[1]
        steered = self._select(True, BURIED_M)
        if len(steered.rows):
            for angle in np.linspace(-drive.steering_limit, drive.steering_limit, SWEEP).tolist():
                angles, _ = drive.targets(0.0, angle)
                parts.append(steered._replace(rows=self._turn(steered, angles)))
        rows, _, *others = map(np.concatenate, zip(*parts, strict=True))
        return OccluderRows(rows, faces, *others)

    def _turn(self, steered: OccluderRows, angles: Sequence[float]) -> Array:
        """Return the rows of steered shapes with the steering joints at ``angles`` [rad]."""
        turned = np.empty_like(steered.rows)
        for row, index, placed in zip(steered.rows, steered.numbers, turned, strict=True):
            joint, pivot = self.steering_of(int(index))
            sin, cos = elementary.sin_cos(angles[joint])
            place_obstacle(relative_row(row, pivot), *pivot, cos, sin, placed)
        return turned

    def steering_of(self, index: int) -> Steering:
        """Return the steering joint of a steered shape."""
        steering = self.shapes[index].steering
        assert steering is not None
        return steering

    @cached_property
    def _arrays(self) -> tuple[Array, Array]:
        rows, faces, _ = sight_rows([(shape.shape, shape.pose) for shape in self.shapes])
        return rows, faces

    def _select(self, steered: bool, buried: float) -> OccluderRows:
        rows, faces = self._arrays
        mask = np.array([(s.steering is not None) == steered for s in self.shapes], dtype=np.bool_)
        rolls = np.array([float(shape.rolls) for shape in self.shapes])[mask]
        inside = np.where(rolls > 0.0, 0.0, buried)
        numbers = np.flatnonzero(mask).astype(float)
        heights = np.array([shape.height_range for shape in self.shapes]).reshape(-1, 2)[mask]
        return OccluderRows(rows[mask], faces, inside, rolls, numbers, heights)


def relative_row(row: Array, pivot: tuple[float, float]) -> Array:
    """Return the row of a shape relative to the vertical axis at ``pivot`` (x, y) [m]."""
    moved = row.copy()
    moved[[AT_X, AT_Y]] -= pivot
    return moved


def find_occluders(
    urdf: Urdf,
    drive: Drive,
    rolling: Collection[str],
    visuals: Mapping[str, Sequence[Shape]] | None,
) -> Occluders:
    """Find the shapes that can block the view of the robot's sensors.

    They are collision shapes, or ``visuals`` by link unless it is ``rolling`` (wheels, casters).
    """
    occluders = []
    for link, shapes in urdf.shapes.items():
        joints = [joint.name for joint in urdf.joints_above(link)]
        steering = _find_steering(urdf, drive, joints)
        if link in rolling:
            placed = rolling_shapes(urdf, link)
        else:
            seen = shapes if visuals is None else visuals.get(link, ())
            placed = [(shape, urdf.poses[link] @ shape.pose) for shape in seen]
        rolls = link in rolling or any(name in drive.wheel_joints for name in joints)
        occluders += [Occluder(link, shape, pose, rolls, steering) for shape, pose in placed]
    return Occluders(tuple(occluders))


def _find_steering(urdf: Urdf, drive: Drive, joints: Sequence[str]) -> Steering | None:
    for index, name in enumerate(drive.steering_joints):
        if name in joints:
            x, y, _ = urdf.poses[urdf.joints[name].child].position
            return Steering(index, (x, y))
    return None
