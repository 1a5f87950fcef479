"""Poses, shapes, and rigid bodies made of shapes."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product as combine
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from evoros.base import checks, elementary
from evoros.base.arrays import Array, product

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


_FEW = 8  # number of shapes below which their boxes would take longer than they save
_ROUNDING_M = 1e-6  # distance [m] within which boxes count as touching


def _numbers(count: int) -> checks.Rule:
    return checks.Rule(
        f"{count} numbers",
        lambda v: isinstance(v, tuple | list) and len(v) == count and all(map(checks.is_number, v)),
    )


@dataclass(frozen=True)
@checks.checked
class Pose:
    """The pose of a frame in another frame; poses compose as ``a_to_c = a_to_b @ b_to_c``."""

    position: Annotated[Vector, _numbers(3)] = (0.0, 0.0, 0.0)  # x, y, z [m]
    quaternion: Annotated[Quaternion, _numbers(4)] = (0.0, 0.0, 0.0, 1.0)  # x, y, z, w, of length 1

    def __post_init__(self) -> None:
        length = math.sqrt(sum(q * q for q in self.quaternion))
        if abs(length - 1.0) > 1e-6:
            raise checks.invalid(self, "quaternion", self.quaternion, "must have length 1")

    @classmethod
    def from_rpy(cls, position: Vector, roll: float, pitch: float, yaw: float) -> "Pose":
        """Create a pose with the rotation Rz(yaw) Ry(pitch) Rx(roll) [rad], as in SDF and URDF."""
        sr, cr = elementary.sin_cos(roll / 2)
        sp, cp = elementary.sin_cos(pitch / 2)
        sy, cy = elementary.sin_cos(yaw / 2)
        return cls(
            position,
            (
                sr * cp * cy - cr * sp * sy,
                cr * sp * cy + sr * cp * sy,
                cr * cp * sy - sr * sp * cy,
                cr * cp * cy + sr * sp * sy,
            ),
        )

    @classmethod
    def from_matrix(cls, position: Sequence[float], rotation: Array) -> "Pose":
        """Create a pose from a rotation matrix (3, 3), orthonormal and right-handed."""
        m = rotation.tolist()
        trace = m[0][0] + m[1][1] + m[2][2]
        # Only the largest component can be computed without cancellation.
        squares = (*(1 - trace + 2 * m[i][i] for i in range(3)), 1 + trace)
        largest = max(range(4), key=squares.__getitem__)
        q = [0.0, 0.0, 0.0, 0.0]
        q[largest] = squares[largest]
        skew = (m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1])
        for i in range(3):
            if largest == 3:
                q[i] = skew[i]
            elif i != largest:
                q[i] = m[i][largest] + m[largest][i]
        if largest != 3:
            q[3] = skew[largest]
        x, y, z = (float(p) for p in position)
        return cls((x, y, z), normalize(q))

    def __matmul__(self, other: "Pose") -> "Pose":
        x1, y1, z1, w1 = self.quaternion
        x2, y2, z2, w2 = other.quaternion
        return Pose(
            self.transform(other.position),
            normalize(
                (
                    w1 * x2 + x1 * w2 + y1 * z2 - z1 * y2,
                    w1 * y2 - x1 * z2 + y1 * w2 + z1 * x2,
                    w1 * z2 + x1 * y2 - y1 * x2 + z1 * w2,
                    w1 * w2 - x1 * x2 - y1 * y2 - z1 * z2,
                )
            ),
        )

    def inverse(self) -> "Pose":
        """Return the pose of the parent frame in this frame."""
        x, y, z, w = self.quaternion
        conjugate = Pose(quaternion=(-x, -y, -z, w))
        px, py, pz = conjugate.transform(self.position)
        return Pose((-px, -py, -pz), conjugate.quaternion)

    def transform(self, point: Vector) -> Vector:
        """Transform a point [m] from this frame to the parent frame."""
        x, y, z = (product(self.rotation, np.array(point)) + self.position).tolist()
        return (x, y, z)

    @property
    def rotation(self) -> Array:
        """The rotation matrix (3, 3), whose columns are this frame's axes."""
        x, y, z, w = self.quaternion
        return np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )

    @property
    def yaw(self) -> float:
        """The heading [rad] of the x axis in the horizontal plane."""
        x, y, z, w = self.quaternion
        return elementary.atan2(2 * (x * y + z * w), 1 - 2 * (y * y + z * z))


def normalize(quaternion: Sequence[float]) -> Quaternion:
    """Scale a nonzero quaternion to length 1."""
    length = math.sqrt(sum(q * q for q in quaternion))
    x, y, z, w = (q / length for q in quaternion)
    return (x, y, z, w)


_SIZES = {"box": 3, "cylinder": 2, "sphere": 1, "plane": 3, "convex": 0, "heightfield": 2}


@dataclass(frozen=True)
class MeshFile:
    """An STL, OBJ or DAE file, and the options for reading it."""

    path: Path
    scale: Vector = (1.0, 1.0, 1.0)
    submesh: str = ""  # name of the part to read; empty for the whole file
    center: bool = False  # whether to move the centre of the bounding box to the origin
    up_axis: bool = False  # whether to apply the <up_axis> of a DAE file


@dataclass(frozen=True)
@checks.checked
class Shape:
    """A solid, a plane or a height field at the origin of its frame.

    ``size`` [m] holds the full lengths along x, y and z of a box; the radius and the length along z
    of a cylinder; or the radius of a sphere. A plane is infinite, and its ``size`` is the normal. A
    convex polyhedron has ``corners`` and no size. A height field has lengths along x and y, and
    ``heights``.
    """

    kind: Annotated[str, checks.one_of(*_SIZES)]
    size: tuple[float, ...]
    pose: Pose = Pose()  # body frame
    corners: tuple[Vector, ...] = ()  # [m]
    heights: tuple[tuple[float, ...], ...] = ()  # [m]; rows from -y to +y, columns from -x to +x
    mesh: MeshFile | None = field(default=None, compare=False, repr=False)
    """The mesh that this shape approximates in part; None if exact or without a mesh."""

    def __post_init__(self) -> None:
        sizes = _numbers(_SIZES[self.kind])
        if not sizes.holds(self.size):
            raise checks.invalid(self, "size", self.size, f"must be {sizes.text}")
        if self.kind == "plane":
            if math.sqrt(sum(n * n for n in self.size)) < 1e-9:
                raise checks.invalid(self, "size", self.size, "must be a normal other than 0 0 0")
        elif self.size and min(self.size) <= 0:
            raise checks.invalid(self, "size", self.size, f"must be above 0 for a {self.kind}")
        if self.kind == "convex":
            _check_corners(self)
        if self.kind == "heightfield":
            rows = self.heights
            if len(rows) < 2 or len(rows[0]) < 2 or any(len(row) != len(rows[0]) for row in rows):
                rule = "must be two or more rows of equal length, each with two or more numbers"
                raise checks.invalid(self, "heights", rows, rule)
            if not np.isfinite(np.array(rows, dtype=np.float64)).all():
                raise checks.invalid(self, "heights", rows, "must be numbers")

    @cached_property
    def points(self) -> Array:
        """The corners (k, 3) [m] of a polyhedron, or of a box around any other solid shape."""
        if self.kind == "convex":
            return np.array(self.corners, dtype=np.float64)
        if self.kind == "heightfield":
            x, y = (length / 2 for length in self.size)
            levels = [edge(map(edge, self.heights)) for edge in (min, max)]
            return np.array([*combine((-x, x), (-y, y), levels)])
        if self.kind == "box":
            half = [length / 2 for length in self.size]
        else:
            half = [self.size[0], self.size[0], self.size[-1] / (2 if len(self.size) > 1 else 1)]
        return np.array([*combine(*((-edge, edge) for edge in half))])


def _check_corners(shape: Shape) -> None:
    corners = np.array(shape.corners, dtype=np.float64)
    if corners.shape[:1] < (4,) or corners.shape[1:] != (3,) or not np.isfinite(corners).all():
        rule = "must be four or more points [x, y, z]"
        raise checks.invalid(shape, "corners", shape.corners, rule)
    if is_flat(corners):
        raise checks.invalid(
            shape, "corners", shape.corners, "must be points that do not all lie in one plane"
        )


def is_flat(corners: Array) -> bool:
    """Return True if points (n, 3) lie in one plane."""
    spread = np.linalg.svd(corners - corners.mean(axis=0), compute_uv=False)  # noqa: TID251
    return bool(spread[2] <= 1e-9 * spread[0])


FRICTION = replace(checks.NOT_NEGATIVE, limit=math.inf)  # 1e10 and more usually mean "never slips"
MASS = checks.Rule("greater than 0 kg, or null if fixed", checks.POSITIVE.holds)


@dataclass(frozen=True)
@checks.checked
class Body:
    """Rigidly connected shapes; a movable body's frame is its principal frame of inertia."""

    name: Annotated[str, checks.TEXT]
    pose: Pose  # pose in the world: centre of mass and principal axes if movable
    shapes: Annotated[tuple[Shape, ...], checks.sequence_of(Shape, "shapes")]
    mass: Annotated[float | None, MASS] = None  # [kg]; None: fixed to the ground
    friction: Annotated[float, FRICTION] = 1.0  # coefficient mu of the surface
    inertia: Annotated[Vector | None, _numbers(3)] = None  # [kg m2], principal; None: homogeneous
    floor: bool = False  # whether robots drive on this fixed body, such as a box

    def __post_init__(self) -> None:
        if not self.shapes:
            raise checks.invalid(self, "shapes", self.shapes, "must have at least one shape")
        kinds = {shape.kind for shape in self.shapes}
        if self.mass is not None and (self.floor or kinds & {"plane", "heightfield"}):
            rule = "must be null for a floor and for a body with a plane or a height field"
            raise checks.invalid(self, "mass", self.mass, rule)
        if self.inertia is not None and min(self.inertia) <= 0:
            raise checks.invalid(self, "inertia", self.inertia, "must be above 0")

    @cached_property
    def placed(self) -> tuple[tuple[Shape, Pose], ...]:
        """The shapes with their poses in the world frame."""
        poses = {pose: self.pose @ pose for pose in {shape.pose for shape in self.shapes}}
        return tuple((shape, poses[shape.pose]) for shape in self.shapes)

    @cached_property
    def boxes(self) -> Array:
        """Boxes (n, 2, 3) [m] around the placed shapes; not the smallest for some round shapes."""
        boxes = np.empty((len(self.shapes), 2, 3))
        groups: dict[Pose, list[int]] = {}
        for i, (shape, pose) in enumerate(self.placed):
            if shape.kind == "plane":
                boxes[i] = [[-math.inf] * 3, [math.inf] * 3]
            else:
                groups.setdefault(pose, []).append(i)
        for pose, members in groups.items():
            spans = [self.shapes[i].points for i in members]
            starts = np.cumsum([0, *map(len, spans[:-1])])
            points = product(np.concatenate(spans), pose.rotation.T) + pose.position
            for side, pick in enumerate((np.minimum, np.maximum)):
                boxes[members, side] = pick.reduceat(points, starts)
        return boxes

    def reach(self, low: Sequence[float], high: Sequence[float]) -> NDArray[np.bool_]:
        """Return a mask (n,) that is False for shapes outside the box between two corners [m]."""
        if len(self.shapes) < _FEW:
            return np.ones(len(self.shapes), dtype=np.bool_)
        lows, highs = self.boxes[:, 0], self.boxes[:, 1]
        inside = (lows <= np.add(high, _ROUNDING_M)) & (highs >= np.subtract(low, _ROUNDING_M))
        return np.asarray(inside.all(axis=1))

    @property
    def is_ground(self) -> bool:
        """True if robots drive on the body; any other body is an obstacle."""
        return self.floor or all(shape.kind in ("plane", "heightfield") for shape in self.shapes)
