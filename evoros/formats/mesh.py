"""Read a mesh file as convex shapes."""

from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.formats.mesh_dae import Surface, read_dae
from evoros.geometry.shapes import Shape, Vector

FORMATS = (".stl", ".obj", ".dae")
THICKNESS_M = 0.002  # of a part that is flat


@lru_cache(maxsize=256)
def read_mesh(
    path: Path, scale: Vector = (1.0, 1.0, 1.0), submesh: str = "", center: bool = False
) -> tuple[Shape, ...]:
    """Read an STL, OBJ or DAE file as convex shapes in the mesh's frame, in metres, with z up.

    ``submesh`` selects one part of the file by its name, and ``center`` moves the middle of its
    bounding box to the origin.

    Raises:
        InputError: the file cannot be read, is empty, or has no such submesh.
    """
    surfaces = _select(path, _read_surfaces(path), submesh)
    triangles = np.concatenate([surface.triangles for surface in surfaces])
    if center:
        points = triangles.reshape(-1, 3)
        triangles = triangles - (points.min(axis=0) + points.max(axis=0)) / 2
    triangles = triangles * np.array(scale)
    if not len(triangles):
        raise InputError(f"{path}: must have a face; export the mesh again")
    if not np.isfinite(triangles).all():
        raise InputError(f"{path}: must have finite coordinates only; export the mesh again")
    shapes = [_hull(points) for points in _components(triangles)]
    return tuple(shape for shape in shapes if shape is not None)


def hull_of(shapes: Iterable[Shape]) -> Shape:
    """Return the convex hull of convex shapes as one shape."""
    corners = [
        np.array(shape.corners) @ shape.pose.rotation.T + shape.pose.position for shape in shapes
    ]
    hull = _hull(np.concatenate(corners))
    assert hull is not None
    return hull


def _read_surfaces(path: Path) -> list[Surface]:
    suffix = path.suffix.lower()
    if suffix not in FORMATS:
        known = ", ".join(FORMATS)
        raise InputError(f"{path}: must be a mesh of a known format ({known}); convert it to one")
    try:
        with path.open("rb") as file:
            file.read(1)
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; correct the path") from None
    except OSError as error:
        raise InputError(f"{path}: must be readable ({error}); correct it") from error
    return read_dae(path) if suffix == ".dae" else _read_trimesh(path, suffix)


def _read_trimesh(path: Path, suffix: str) -> list[Surface]:
    import trimesh  # takes a second, which cached meshes save

    try:
        options: dict[str, Any] = {"process": False}
        if suffix == ".obj":
            options |= {"skip_materials": True, "split_objects": True}
        scene = trimesh.load_scene(path, **options)
    except Exception as error:  # trimesh raises errors of many types
        raise InputError(
            f"{path}: must be an {suffix[1:].upper()} file ({error}); export the mesh again"
        ) from error
    return [
        Surface((name,), np.array(mesh.triangles, dtype=np.float64))
        for name, mesh in scene.geometry.items()
        if isinstance(mesh, trimesh.Trimesh)
    ]


def _select(path: Path, surfaces: list[Surface], submesh: str) -> list[Surface]:
    chosen = [surface for surface in surfaces if not submesh or submesh in surface.names]
    if submesh and not chosen:
        names = dict.fromkeys(name for surface in surfaces for name in surface.names)
        raise InputError(
            f"{path}: submesh {submesh!r} must exist; name one of: {', '.join(names) or 'none'}"
        )
    if not chosen:
        raise InputError(f"{path}: must have a face; export the mesh again")
    return chosen


def _components(triangles: Array) -> list[Array]:
    """Return the points of each connected part of a surface."""
    points, indices = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    faces = indices.reshape(-1, 3)
    rows, columns = faces[:, [0, 1]].T.ravel(), faces[:, [1, 2]].T.ravel()
    links = coo_array((np.ones(len(rows)), (rows, columns)), shape=(len(points), len(points)))
    count, labels = connected_components(links, directed=False)
    return [points[labels == label] for label in range(count)]


def _hull(points: Array) -> Shape | None:
    """Return the convex hull of points; a flat one gets a thickness; None if it has no area."""
    centre = points.mean(axis=0)
    _, spread, axes = np.linalg.svd(points - centre, full_matrices=False)
    if len(spread) < 2 or spread[1] < 1e-3:
        return None
    local = (points - centre) @ axes.T
    if len(axes) < 3 or np.ptp(local[:, 2]) < 1e-6:
        normal = np.cross(axes[0], axes[1]) * THICKNESS_M / 2
        points = np.concatenate([points - normal, points + normal])
    corners = points[ConvexHull(points, qhull_options="QJ Pp").vertices]
    return Shape("convex", (), corners=tuple(map(tuple, corners.tolist())))
