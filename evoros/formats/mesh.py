"""Reads mesh files as convex shapes, with a cache in the user's cache folder."""

import hashlib
import itertools
import json
import os
import re
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Self, TypeVar

import numpy as np

from evoros.base.arrays import Array
from evoros.base.errors import InputError, write_count
from evoros.files.private import private_folder
from evoros.formats.mesh_files import read_content, read_faces
from evoros.geometry.polyhedron import placed_corners
from evoros.geometry.shapes import MeshFile, Shape, Vector, is_flat

TOLD_M = 0.01  # minimum deviation [m] to report
WORK = 3e6  # maximum work per mesh (see ``divide_mesh``), about 5 s on one core
_VERSION = 4  # version, increased with every change of the algorithm
Corners = tuple[Vector, ...]
T = TypeVar("T")


@dataclass(frozen=True)
class Mesh:
    """A mesh as convex shapes."""

    shapes: tuple[Shape, ...]
    deviation_m: float  # maximum distance [m] from the surface of the mesh to the shapes
    remarks: tuple[str, ...]  # messages on omitted parts and ignored settings
    work: float  # work spent on the shapes (see divide_mesh)
    is_cut_short: bool  # whether more work would give better shapes

    @property
    def notes(self) -> tuple[str, ...]:
        """Messages on the approximation, if any, followed by the ``remarks``."""
        if self.deviation_m <= TOLD_M:
            return self.remarks
        count = len(self.shapes)
        parts = "its convex hull" if count == 1 else f"{count} convex parts"
        deviation = f"up to {1e3 * self.deviation_m:.0f} mm from the mesh's surface"
        return (f"the mesh is replaced with {parts} ({deviation})", *self.remarks)


def read_mesh(file: MeshFile, work: float = WORK, uses: int = 1) -> Mesh:
    """Read a file as convex shapes in the mesh frame; see ``divide_mesh`` for the limits."""
    return _read(file, _make_key(file), work, uses)


def find_box(file: MeshFile) -> Array:
    """Return the minimum and maximum corner (2, 3) [m] of a mesh."""
    return _find_box(file, _make_key(file))


@lru_cache(maxsize=1024)
def _find_box(file: MeshFile, key: str) -> Array:
    box = _load(f"{key}-box", lambda stored: np.array(stored, dtype=np.float64).reshape(2, 3))
    if box is None:
        triangles = read_faces(file).triangles
        box = np.array([triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))])
        _store(f"{key}-box", box.tolist())
        if sum(map(len, _FACES.values())) + len(triangles) <= _MOST_FACES:
            _FACES[key] = triangles
    return box


_FACES: dict[str, Array] = {}  # triangles of meshes with known boxes, by key
_MOST_FACES = 3_000_000  # maximum number of triangles kept in memory, 0.2 GB


def _make_key(file: MeshFile) -> str:
    scale, choices = (*map(float, file.scale),), (file.submesh, file.center, file.up_axis)
    parameters = repr((file.path.suffix.lower(), scale, *choices))
    return hashlib.sha256(parameters.encode() + read_content(file.path)).hexdigest()


@lru_cache(maxsize=256)
def read_hull(file: MeshFile) -> Shape:
    """Read a file as its convex hull, which is fast."""
    from evoros.geometry.hull import make_hull, simplify  # slow: imports scipy

    read_content(file.path)
    points = read_faces(file).triangles.reshape(-1, 3)
    low, high = points.min(axis=0), points.max(axis=0)
    if float((high - low).max()) < 1e-3:
        raise _too_small(file.path)
    hull = make_hull(points)
    if hull is not None:
        return _shape(_corners(simplify(hull)[0].corners))
    box = zip(low, np.maximum(high, low + 1e-3), strict=True)  # around flat points
    return _shape(_corners(np.array([*itertools.product(*box)])))


@lru_cache(maxsize=256)
def find_hull_gap(file: MeshFile) -> float:
    """Return the maximum distance [m] from the convex hull to the surface of a mesh file."""
    from evoros.geometry.hull import find_gap  # slow: imports scipy
    from evoros.geometry.triangles import weld

    return find_gap(weld(read_faces(file).triangles))


def hull_of(shapes: Iterable[Shape]) -> Shape:
    """Return the convex hull of several convex shapes as one shape."""
    from evoros.geometry.hull import make_hull, simplify  # slow: imports scipy

    corners = [placed_corners(s.corners, s.pose.rotation, s.pose.position) for s in shapes]
    hull = make_hull(np.concatenate(corners))
    if hull is None:
        raise ValueError("the shapes are too small for a hull")
    return _shape(_corners(simplify(hull)[0].corners))


@lru_cache(maxsize=1024)
def _read(file: MeshFile, key: str, work: float, uses: int) -> Mesh:
    triangles, name = _FACES.pop(key, None), f"{key}-{float(work)}-{uses}"
    division = _load(name, _Division.parse)
    if division is None:
        from evoros.geometry.mesh_parts import divide_mesh  # slow: imports scipy

        triangles = read_faces(file).triangles if triangles is None else triangles
        parts = divide_mesh(triangles, work, uses)
        corners = tuple(_corners(hull.corners) for hull in parts.hulls)
        size = parts.dropped, parts.deviation
        division = _Division(corners, *size, parts.work, parts.is_cut_short)
        if not division.parts:
            raise _too_small(file.path)
        _store(name, asdict(division))
    remarks = tuple(_list_remarks(file, division.dropped))
    origin = file if division.deviation_m > TOLD_M else None
    solid = (corners for corners in division.parts if not is_flat(np.array(corners)))
    shapes = tuple(replace(_shape(corners), mesh=origin) for corners in solid)
    if not shapes:
        raise _too_small(file.path)
    return Mesh(shapes, division.deviation_m, remarks, division.work, division.is_cut_short)


def _too_small(path: Path) -> InputError:
    problem = "all parts are smaller than 1 mm"
    return InputError(f"{path}: {problem}; increase the mesh's scale, or export the mesh again")


def _list_remarks(file: MeshFile, dropped: int) -> Iterator[str]:
    if dropped:
        yield f"left out: {write_count(dropped, 'part')} smaller than 1 mm"
    with file.path.open("rb") as content:
        axis = re.search(rb"<up_axis>\s*([XY]_UP)", content.read(100_000))
    if axis and file.path.suffix.lower() == ".dae" and not file.up_axis:
        name = axis[1].decode()
        yield f"the up axis {name} is ignored, as in Gazebo Classic and RViz; z points up"


def _corners(points: Array) -> Corners:
    # Linear algebra libraries differ in the last bits between machines, so round.
    return tuple((x, y, z) for x, y, z in (np.round(points, 7) + 0.0).tolist())


def _shape(corners: Corners) -> Shape:
    return Shape("convex", (), corners=corners)


@dataclass(frozen=True)
class _Division:
    parts: tuple[Corners, ...]  # corners [m] of each part
    dropped: int  # number of parts omitted because they are too small
    deviation_m: float  # maximum distance [m] from the surface of the mesh to the parts
    work: float
    is_cut_short: bool

    @classmethod
    def parse(cls, stored: dict[str, Any]) -> Self | None:
        parts = tuple(tuple((x, y, z) for x, y, z in part) for part in stored["parts"])
        is_whole = parts and all(len(part) >= 4 for part in parts)
        return cls(**stored | {"parts": parts}) if is_whole else None


def _load(name: str, parse: Callable[[Any], T | None]) -> T | None:
    folder = private_folder("meshes")
    if folder is not None:
        with suppress(OSError, ValueError, TypeError, KeyError, RecursionError):
            path = folder / f"{_VERSION}-{name}.json"
            return parse(json.loads(path.read_text(encoding="utf-8")))
    return None


def _store(name: str, content: object) -> None:
    folder = private_folder("meshes")
    if folder is None:
        return
    with suppress(OSError):
        with tempfile.NamedTemporaryFile("w", dir=folder, delete=False) as unfinished:
            json.dump(content, unfinished)
        os.replace(unfinished.name, folder / f"{_VERSION}-{name}.json")
