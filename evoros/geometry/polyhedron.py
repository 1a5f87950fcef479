"""Convex polyhedra and polygons: faces, edges, volumes, moments of inertia, decomposition."""

import itertools
import math
from collections.abc import Sequence
from functools import lru_cache
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evoros.base.arrays import Array, determinant, length, product
from evoros.geometry.shapes import Shape, Vector
from evoros.geometry.triangles import Indices, Surface, find_normals, group_connected, list_edges

_SAME_FACE = 9  # number of decimals to which the planes of a face's triangles agree


class Polyhedron(NamedTuple):
    """The convex hull of points; the arrays must not be written to."""

    corners: Array  # (k, 3) [m], only those on the hull
    triangles: NDArray[np.intp]  # (t, 3) corner indices, counter-clockwise as seen from outside
    edges: NDArray[np.intp]  # (e, 2) corner indices, including edges between coplanar triangles
    faces: Array  # (f, 4): a point p is inside if faces[:, :3] @ p <= faces[:, 3] [m]


@lru_cache(maxsize=2**15)  # enough for the parts of one furnished building
def convex_polyhedron(corners: tuple[Vector, ...]) -> Polyhedron:
    """Return the convex hull of points [m] that do not lie in a common plane."""
    points = np.array(corners, dtype=np.float64)
    hull = _hull(points)
    numbers = np.full(len(points), -1)
    numbers[hull.vertices] = np.arange(len(hull.vertices))
    triangles = hull.simplices.copy()
    inwards = (find_normals(points[triangles]) * hull.equations[:, :3]).sum(axis=1) < 0.0
    triangles[inwards] = triangles[inwards][:, ::-1]
    triangles = numbers[triangles]
    edges, faces = np.unique(list_edges(triangles), axis=0), _distinct_planes(hull.equations)
    return Polyhedron(points[hull.vertices], triangles, edges.astype(np.intp), faces)


def hull_planes(points: Array) -> tuple[Array, Array]:
    """Return the faces (see ``Polyhedron``) and corners (k, 3) of the hull of points (n, 3) [m]."""
    hull = _hull(points)
    return _distinct_planes(hull.equations), points[hull.vertices]


def _hull(points: Array) -> Any:
    from scipy.spatial import ConvexHull, QhullError  # imports slower than most worlds load

    try:
        return ConvexHull(points)
    except QhullError:  # nearly flat: let Qhull joggle the points by rounding errors
        return ConvexHull(points, qhull_options="QJ Pp")


def _distinct_planes(equations: Array) -> Array:
    planes = np.unique(np.round(equations, _SAME_FACE), axis=0, return_index=True)[1]
    return np.asarray(equations[np.sort(planes)] * (1.0, 1.0, 1.0, -1.0))


def box_corners(box: Shape) -> Array:
    """Return the corners (8, 3) [m] of a box in its frame."""
    return np.asarray(np.array(list(itertools.product((-1, 1), repeat=3))) * np.array(box.size) / 2)


def clip_polyhedron(corners: Array, edges: NDArray[np.intp], low: float, high: float) -> Array:
    """Return points (n, 3) that span a convex polyhedron between two heights z [m]."""
    kept = [corners[(corners[:, 2] >= low) & (corners[:, 2] <= high)]]
    first, second = corners[edges[:, 0]], corners[edges[:, 1]]
    for height in (low, high):
        crosses = (first[:, 2] - height) * (second[:, 2] - height) < 0.0
        start, end = first[crosses], second[crosses]
        share = (height - start[:, 2:]) / (end[:, 2:] - start[:, 2:])
        kept.append(start + share * (end - start))
    return np.concatenate(kept)


def solid_properties(corners: tuple[Vector, ...]) -> tuple[float, Array, Array]:
    """Return a convex solid's volume [m3], centre (3,) [m] and inertia (3, 3) [m5] at density 1."""
    solid = convex_polyhedron(corners)
    inside = solid.corners.mean(axis=0)
    tetrahedra = solid.corners[solid.triangles] - inside  # relative to the fourth corner (inside)
    volumes = determinant(tetrahedra) / 6.0
    volume = float(volumes.sum())
    centre = product(volumes, tetrahedra.sum(axis=1)) / 4.0 / volume
    # The integral of x xT over a tetrahedron with a corner at the origin and corner sum s
    sums = tetrahedra.sum(axis=1)
    places = np.concatenate([tetrahedra, sums[:, None]], axis=1)
    squares = (places[..., None] * places[..., None, :]).sum(axis=1)
    products = (volumes[:, None, None] * squares).sum(axis=0)
    second = products / 20.0 - volume * np.outer(centre, centre)
    return volume, inside + centre, np.trace(second) * np.eye(3) - second


def placed_corners(
    corners: Sequence[Vector] | Array, rotation: Array, position: Sequence[float]
) -> Array:
    """Return corners (k, 3) [m], rotated and then moved, in the frame of ``position``."""
    return np.asarray(product(np.asarray(corners, dtype=np.float64), rotation.T) + position)


Ring = list[tuple[float, float]]
_FLAT = 1e-6  # [m] and [rad], maximum deviation of coplanar faces


def divide_into_polygons(surface: Surface) -> list[Array]:
    """Return convex polygons (k, 3) [m] that cover the surface, facet by facet."""
    corners = surface.triangles
    normals = find_normals(corners)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    # Both sides of a sheet have the same plane.
    largest = np.abs(normals).argmax(axis=1)[:, None]
    normals *= np.sign(np.take_along_axis(normals, largest, axis=1))
    polygons: list[Array] = []
    for group in _facets(surface.faces, normals, (normals * corners[:, 0]).sum(axis=1)):
        polygons += _merge(surface.points, surface.faces[group], normals[group[0]])
    return polygons


def _facets(faces: Indices, normals: Array, offsets: Array) -> list[Indices]:
    """Return the faces of each facet, a set of connected coplanar faces."""
    edges = list_edges(faces)
    owners = np.tile(np.arange(len(faces)), 3)
    order = np.lexsort((owners, edges[:, 1], edges[:, 0]))
    same = (edges[order[:-1]] == edges[order[1:]]).all(axis=1)
    a, b = owners[order[:-1]][same], owners[order[1:]][same]
    flat = np.abs(normals[a] - normals[b]).max(axis=1) < _FLAT
    flat &= np.abs(offsets[a] - offsets[b]) < _FLAT
    return group_connected(a[flat], b[flat], len(faces), len(faces))


def _merge(points: Array, faces: Indices, normal: Array) -> list[Array]:
    """Merge the triangles of a facet across their longest edges while the results are convex."""
    axis = int(np.abs(normal).argmax())
    used, corners = np.unique(faces, return_inverse=True)
    points = points[used]
    flat = points[:, [(axis + 1) % 3, (axis + 2) % 3]].tolist()
    loops: dict[int, list[int]] = {}
    owner: dict[tuple[int, int], int] = {}
    for index, (i, j, k) in enumerate(corners.reshape(-1, 3).tolist()):
        loop = [i, j, k] if _turn(flat, i, j, k) > 0 else [i, k, j]
        loops[index] = loop
        owner |= dict.fromkeys(_edges_of(loop), index)
    inner = [(i, j) for i, j in owner if i < j and (j, i) in owner]
    inner.sort(key=lambda edge: (-length(points[edge[0]] - points[edge[1]]), edge))
    for i, j in inner:
        first, second = owner[i, j], owner[j, i]
        merged = _join(loops[first], loops[second], i, j)
        if first != second and _is_convex(flat, merged):
            del loops[second]
            loops[first] = merged
            owner |= dict.fromkeys(_edges_of(merged), first)
    return [points[loop] for loop in loops.values()]


def _edges_of(loop: list[int]) -> list[tuple[int, int]]:
    return list(zip(loop, loop[1:] + loop[:1], strict=True))


def _join(first: list[int], second: list[int], i: int, j: int) -> list[int]:
    """Join two loops at an edge: i to j in the first loop, j to i in the second."""
    a, b = first.index(j), second.index(i)
    return (first[a:] + first[:a])[:-1] + (second[b:] + second[:b])[:-1]


def _turn(flat: list[list[float]], i: int, j: int, k: int) -> float:
    """Return twice the area [m2] of a triangle, positive if it is counter-clockwise."""
    (ax, ay), (bx, by), (cx, cy) = flat[i], flat[j], flat[k]
    return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)


def _is_convex(flat: list[list[float]], loop: list[int]) -> bool:
    if len(set(loop)) < len(loop):
        return False
    turns = (_turn(flat, loop[n - 2], loop[n - 1], loop[n]) >= -1e-12 for n in range(len(loop)))
    return all(turns)


def decompose(rings: Sequence[Ring]) -> list[Ring]:
    """Return convex counter-clockwise polygons that together cover the inside of the rings.

    A ring inside another ring is a hole. An empty or self-intersecting ring raises a ValueError.
    """
    from manifold3d import CrossSection, FillRule, triangulate

    areas = [CrossSection([np.array(ring)], FillRule.EvenOdd) for ring in rings]
    for ring, area in zip(rings, areas, strict=True):
        x, y = np.array(ring).T
        enclosed = abs(float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum()) / 2)
        if enclosed < 1e-12:
            raise ValueError("it encloses nothing")
        if abs(area.area() - enclosed) > 1e-6 * enclosed:
            raise ValueError("it crosses itself")
    for one, other in combinations(areas, 2):
        common, smaller = (one ^ other).area(), min(one.area(), other.area())
        if 1e-6 * smaller < common < (1 - 1e-6) * smaller:
            raise ValueError("it crosses itself")
    polygons = CrossSection([np.array(ring) for ring in rings], FillRule.EvenOdd).to_polygons()
    corners = np.concatenate(polygons)
    points = np.column_stack([corners, np.zeros(len(corners))])
    pieces = divide_into_polygons(Surface(points, np.asarray(triangulate(polygons), np.int64)))
    return [[(x, y) for x, y, _ in piece.tolist()] for piece in pieces]


def solid_moments(shape: Shape, mass: float) -> Vector:
    """Return a homogeneous solid's moments [kg m2] about its centre, along its frame's axes."""
    if shape.kind == "box":
        x, y, z = shape.size
        sums = (y * y + z * z, x * x + z * z, x * x + y * y)
        return (mass / 12 * sums[0], mass / 12 * sums[1], mass / 12 * sums[2])
    if shape.kind == "sphere":
        moment = 0.4 * mass * shape.size[0] * shape.size[0]
        return (moment, moment, moment)
    if shape.kind == "convex":
        xx, yy, zz = _solid_tensor(shape, mass).diagonal().tolist()
        return (xx, yy, zz)
    radius, length = shape.size
    across = mass / 12 * (3 * radius * radius + length * length)
    return (across, across, mass / 2 * radius * radius)


def joint_moments(shapes: Sequence[Shape], mass: float) -> Vector:
    """Return the moments [kg m2] of shapes of equal density with a total mass [kg]."""
    volumes = [solid_volume(shape) for shape in shapes]
    total = np.zeros((3, 3))
    for shape, volume in zip(shapes, volumes, strict=True):
        share = mass * volume / sum(volumes)
        rotation = shape.pose.rotation
        total += product(product(rotation, _solid_tensor(shape, share)), rotation.T)
        total += point_tensor(share, np.array(shape.pose.transform(solid_centre(shape))))
    xx, yy, zz = total.diagonal().tolist()
    return (xx, yy, zz)


def solid_volume(shape: Shape) -> float:
    """Return the volume [m3] of a solid shape."""
    if shape.kind == "convex":
        return solid_properties(shape.corners)[0]
    if shape.kind == "box":
        return math.prod(shape.size)
    if shape.kind == "sphere":
        return 4.0 / 3.0 * math.pi * shape.size[0] * shape.size[0] * shape.size[0]
    return math.pi * shape.size[0] * shape.size[0] * shape.size[1]


def solid_centre(shape: Shape) -> Vector:
    """Return a homogeneous shape's centre of mass [m] in the shape's frame."""
    if shape.kind != "convex":
        return (0.0, 0.0, 0.0)
    x, y, z = solid_properties(shape.corners)[1].tolist()
    return (x, y, z)


def _solid_tensor(shape: Shape, mass: float) -> Array:
    if shape.kind != "convex":
        return np.diag(solid_moments(shape, mass))
    volume, _, tensor = solid_properties(shape.corners)
    return tensor * (mass / volume)


def point_tensor(mass: float, offset: Array) -> Array:
    """Return the inertia tensor (3, 3) [kg m2] of a point mass at ``offset`` (3,) [m]."""
    return np.asarray(mass * (product(offset, offset) * np.eye(3) - np.outer(offset, offset)))


def symmetric_tensor(xx: float, yy: float, zz: float, xy: float, xz: float, yz: float) -> Array:
    """Return the symmetric matrix (3, 3) with these six components."""
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
