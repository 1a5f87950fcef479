"""Read a mesh file as convex shapes, of which the user's cache folder keeps a file for each mesh.

A cache that is missing, damaged or read-only only costs time.
"""

import hashlib
import itertools
import json
import os
import re
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.base.linear import product
from evoros.files.private import cache_home
from evoros.formats.mesh_files import read_content, read_faces
from evoros.geometry.shapes import Shape, Vector

TOLD_M = 0.01  # deviation from which on the user is told
_VERSION = 1  # changes with the algorithm

Corners = tuple[Vector, ...]


@dataclass(frozen=True)
class Mesh:
    """A mesh as convex shapes."""

    shapes: tuple[Shape, ...]
    deviation_m: float  # largest distance of the mesh's surface from the shapes'
    remarks: tuple[str, ...]  # what is left out or not applied

    @property
    def notes(self) -> tuple[str, ...]:
        """All approximations, then the ``remarks``."""
        if self.deviation_m <= TOLD_M:
            return self.remarks
        count = len(self.shapes)
        parts = "its convex hull stands" if count == 1 else f"{count} convex parts stand"
        deviation = f"up to {1e3 * self.deviation_m:.0f} mm off its surface"
        return (f"{parts} for the mesh, {deviation}", *self.remarks)


def read_mesh(
    path: Path,
    scale: Vector = (1.0, 1.0, 1.0),
    submesh: str = "",
    center: bool = False,
    up_axis: bool = False,
) -> Mesh:
    """Read an STL, OBJ or DAE file as convex shapes in the mesh's frame.

    ``submesh`` selects one part of the file by its name, and ``center`` moves the middle of its
    bounding box to the origin. ``up_axis`` turns a DAE as its ``<up_axis>`` says. Results are kept
    in the user's cache folder.

    Raises:
        InputError: the file cannot be read, is empty, or has no such submesh.
    """
    content = read_content(path)
    parameters = repr((path.suffix.lower(), (*map(float, scale),), submesh, bool(center), up_axis))
    key = hashlib.sha256(parameters.encode() + content).hexdigest()
    return _read(path, key, scale, submesh, center, up_axis)


@lru_cache(maxsize=256)
def read_hull(path: Path, scale: Vector = (1.0, 1.0, 1.0)) -> Shape:
    """Read the convex hull of all that is in an STL, OBJ or DAE file, which takes little time.

    Raises:
        InputError: the file cannot be read, is empty, or too small for a hull.
    """
    from evoros.geometry.hull import make_hull, simplify  # with scipy, which takes long to import

    read_content(path)
    points = read_faces(path, scale).triangles.reshape(-1, 3)
    low, high = points.min(axis=0), points.max(axis=0)
    if float((high - low).max()) < 1e-3:
        raise _too_small(path)
    hull = make_hull(points)
    if hull is not None:
        return _shape(_corners(simplify(hull)[0].corners))
    box = zip(low, np.maximum(high, low + 1e-3), strict=True)  # around points that are flat
    return _shape(_corners(np.array([*itertools.product(*box)])))


@lru_cache(maxsize=256)
def find_hull_gap(path: Path, scale: Vector = (1.0, 1.0, 1.0)) -> float:
    """Return how far [m] the convex hull of a mesh file is off the mesh's surface."""
    from evoros.geometry.convex_parts import find_gap  # with scipy, which takes long to import
    from evoros.geometry.triangles import weld

    return find_gap(weld(read_faces(path, scale).triangles))


def hull_of(shapes: Iterable[Shape]) -> Shape:
    """Return the convex hull of convex shapes as one shape."""
    from evoros.geometry.hull import make_hull, simplify  # with scipy, which takes long to import

    corners = [
        product(np.array(shape.corners), shape.pose.rotation.T) + shape.pose.position
        for shape in shapes
    ]
    hull = make_hull(np.concatenate(corners))
    if hull is None:
        raise ValueError("the shapes are too small for a hull")
    return _shape(_corners(simplify(hull)[0].corners))


@lru_cache(maxsize=1024)
def _read(path: Path, key: str, scale: Vector, submesh: str, center: bool, up_axis: bool) -> Mesh:
    division = _load(key)
    if division is None:
        from evoros.geometry.mesh_parts import divide_mesh  # with scipy, which takes long to import

        parts = divide_mesh(read_faces(path, scale, submesh, center, up_axis).triangles)
        corners = tuple(_corners(hull.corners) for hull in parts.hulls)
        division = _Division(corners, parts.dropped, parts.deviation)
        if not division.parts:
            raise _too_small(path)
        _store(key, division)
    remarks = tuple(_list_remarks(path, division.dropped, up_axis))
    return Mesh(tuple(map(_shape, division.parts)), division.deviation_m, remarks)


def _too_small(path: Path) -> InputError:
    problem = "must have a part of at least 1 mm"
    return InputError(f"{path}: {problem}; correct the scale, or export the mesh again")


def _list_remarks(path: Path, dropped: int, up_axis: bool) -> Iterator[str]:
    if dropped:
        yield f"parts below 1 mm are left out, {dropped} in number"
    with path.open("rb") as file:
        axis = re.search(rb"<up_axis>\s*([XY]_UP)", file.read(100_000))
    if axis and path.suffix.lower() == ".dae" and not up_axis:
        name = axis[1].decode()
        yield f"its up axis {name} is not applied, as in Gazebo Classic and RViz; z is up"


def _corners(points: Array) -> Corners:
    # Libraries of linear algebra differ in the last bits from machine to machine.
    return tuple((x, y, z) for x, y, z in (np.round(points, 7) + 0.0).tolist())


def _shape(corners: Corners) -> Shape:
    return Shape("convex", (), corners=corners)


@dataclass(frozen=True)
class _Division:
    """The convex parts of a mesh."""

    parts: tuple[Corners, ...]  # the corners [m] of each part
    dropped: int  # number of parts that are too small to count
    deviation_m: float  # largest distance of the mesh's surface from the parts'


def _load(key: str) -> _Division | None:
    with suppress(OSError, ValueError, TypeError, KeyError, RecursionError):
        stored = json.loads(_file(key).read_text(encoding="utf-8"))
        parts = tuple(
            tuple((float(x), float(y), float(z)) for x, y, z in part) for part in stored["parts"]
        )
        if parts and all(len(part) >= 4 for part in parts):
            return _Division(parts, int(stored["dropped"]), float(stored["deviation_m"]))
    return None


def _store(key: str, division: _Division) -> None:
    """Store parts under a key, all or nothing, for this and other processes."""
    file = _file(key)
    with suppress(OSError):
        file.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        with tempfile.NamedTemporaryFile(
            "w", encoding="utf-8", dir=file.parent, delete=False
        ) as unfinished:
            json.dump(asdict(division), unfinished)
        os.replace(unfinished.name, file)


def _file(key: str) -> Path:
    return Path(cache_home()) / "evoros" / "meshes" / f"{_VERSION}-{key}.json"
