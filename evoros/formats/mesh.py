"""Read a mesh file as convex shapes, of which the user's cache folder keeps a file for each mesh.

A cache that is missing, damaged or read-only only costs time.
"""

import hashlib
import itertools
import json
import logging
import os
import re
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.base.linear import product
from evoros.files.private import cache_home
from evoros.files.resources import read_file
from evoros.formats.mesh_dae import Submesh, read_dae
from evoros.formats.strict_xml import list_names, shorten
from evoros.geometry.shapes import Shape, Vector

FORMATS = (".stl", ".obj", ".dae")
TOLD_M = 0.01  # deviation from which on the user is told
_NOWHERE = logging.NullHandler()  # for tracebacks of attempts, where nobody has asked for logs
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
    content = _read_content(path)
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

    _read_content(path)
    points = _triangles(path, scale, "", False).reshape(-1, 3)
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

    return find_gap(weld(_triangles(path, scale, "", False)))


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


def _read_content(path: Path) -> bytes:
    if path.suffix.lower() not in FORMATS:
        known = ", ".join(FORMATS)
        raise InputError(f"{path}: must be a mesh of a known format ({known}); convert it to one")
    return read_file(path)


@lru_cache(maxsize=1024)
def _read(path: Path, key: str, scale: Vector, submesh: str, center: bool, up_axis: bool) -> Mesh:
    division = _load(key)
    if division is None:
        from evoros.geometry.mesh_parts import divide_mesh  # with scipy, which takes long to import

        parts = divide_mesh(_triangles(path, scale, submesh, center, up_axis))
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


def _triangles(
    path: Path, scale: Vector, submesh: str, center: bool, up_axis: bool = False
) -> Array:
    """Return the triangles (n, 3, 3) [m] to be read; a mirroring scale keeps their outsides."""
    is_dae = path.suffix.lower() == ".dae"
    parts = read_dae(path, up_axis) if is_dae else _read_with_trimesh(path, submesh)
    chosen = _select(path, parts, submesh)
    if any(part.triangles.shape[1:] != (3, 3) for part in chosen):
        raise InputError(f"{path}: must have three coordinates a corner; export the mesh again")
    triangles = np.concatenate([part.triangles for part in chosen]) if chosen else np.empty(0)
    if not len(triangles):
        raise InputError(f"{path}: must have a face; export the mesh again")
    if not np.isfinite(triangles).all():
        raise InputError(f"{path}: must have finite coordinates only; export the mesh again")
    if center:
        points = triangles.reshape(-1, 3)
        triangles = triangles - (points.min(axis=0) + points.max(axis=0)) / 2
    triangles = triangles * np.array(scale, dtype=np.float64)
    return triangles[:, ::-1] if np.prod(scale) < 0 else triangles


def _read_with_trimesh(path: Path, submesh: str) -> list[Submesh]:
    """Read an STL or OBJ file; a submesh of an OBJ file may be an object or a group."""
    import trimesh  # takes a second, which meshes from the cache save

    logging.getLogger("trimesh").addHandler(_NOWHERE)
    splits = ("split_objects", "split_groups") if submesh else ("split_objects",)
    parts: dict[str, Submesh] = {}
    for split in splits:
        options: dict[str, Any] = {"process": False}
        if path.suffix.lower() == ".obj":
            options |= {"skip_materials": True, split: True}
        try:
            scene = trimesh.load_scene(path, **options)
        except Exception as error:  # trimesh raises errors of many types
            kind = path.suffix[1:].upper()
            reason = shorten(str(error).partition("\n")[0])
            problem = f"must be a mesh in the format {kind} ({reason})"
            raise InputError(f"{path}: {problem}; export the mesh again") from error
        for name, mesh in scene.geometry.items():
            if isinstance(mesh, trimesh.Trimesh):
                triangles = np.array(mesh.triangles, dtype=np.float64)
                parts.setdefault(name, Submesh((name,), triangles))
    return list(parts.values())


def _select(path: Path, parts: list[Submesh], submesh: str) -> list[Submesh]:
    chosen = [part for part in parts if not submesh or submesh in part.names]
    if submesh and not chosen:
        names = list_names(dict.fromkeys(name for part in parts for name in part.names))
        raise InputError(f"{path}: submesh {submesh!r} must exist; name one of: {names}")
    return chosen


@dataclass(frozen=True)
class _Division:
    """The convex parts of a mesh."""

    parts: tuple[Corners, ...]  # the corners [m] of each part
    dropped: int  # number of parts that are too small to count
    deviation_m: float  # largest distance of the mesh's surface from the parts'


def _load(key: str) -> _Division | None:
    with suppress(OSError, ValueError, TypeError, KeyError, RecursionError):
        stored = json.loads(_file(key).read_text())
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
        with tempfile.NamedTemporaryFile("w", dir=file.parent, delete=False) as unfinished:
            json.dump(asdict(division), unfinished)
        os.replace(unfinished.name, file)


def _file(key: str) -> Path:
    return Path(cache_home()) / "evoros" / "meshes" / f"{_VERSION}-{key}.json"
