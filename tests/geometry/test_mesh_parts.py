"""The convex parts of a mesh fill what it encloses, and nothing else."""

from itertools import pairwise, product
from typing import Any

import numpy as np
import pytest
import trimesh
from hypothesis import example, given, settings
from hypothesis import strategies as st
from mesh_cases import grid_mesh
from numpy.typing import NDArray

from evoros.base.arrays import Array
from evoros.geometry import mesh_parts
from evoros.geometry.convex_parts import TOLERANCE_M
from evoros.geometry.hull import MOST_CORNERS
from evoros.geometry.mesh_parts import Parts, compare_sections, divide_mesh
from evoros.geometry.shapes import Pose
from evoros.geometry.triangles import Surface, find_normals, join_near, weld


def turned(triangles: Array) -> Array:
    pose = Pose.from_rpy((0.3, -2.0, 1.0), 0.2, -0.3, 0.6)
    result: Array = triangles @ pose.rotation.T + pose.position
    return result


def volume(parts: Parts) -> float:
    return sum(hull.volume for hull in parts.hulls)


def inside(parts: Parts, *points: tuple[float, float, float]) -> bool:
    return any((hull.depth(np.array(points)) > 0).any() for hull in parts.hulls)


ROOM = np.ones((3, 3, 2), dtype=bool)
ROOM[1, 1, 1] = False
WALLS = np.ones((3, 3, 1), dtype=bool)
WALLS[1, 1, 0] = False
CLOSED = np.ones((3, 3, 3), dtype=bool)
CLOSED[1, 1, 1] = False
DOOR = np.ones((3, 1, 2), dtype=bool)
DOOR[1, 0, 0] = False
EL = np.ones((2, 2, 1), dtype=bool)
EL[1, 1, 0] = False
TABLE = np.zeros((5, 5, 2), dtype=bool)
TABLE[:, :, 1] = True
TABLE[1::2, 1::2, 0] = True


@pytest.mark.parametrize("turn", [False, True])
@pytest.mark.parametrize(
    ("filled", "lines", "count", "solid"),
    [
        (EL, [[0, 1, 3], [0, 1, 2], [0, 1]], 2, 4.0),
        (WALLS, [[0, 0.1, 3.9, 4], [0, 0.1, 5.9, 6], [0, 2.5]], 4, 4.9),
        (WALLS, [[0, 0.01, 3.99, 4], [0, 0.01, 5.99, 6], [0, 2.5]], 4, 0.499),
        (ROOM, [[0, 0.1, 3.9, 4], [0, 0.1, 5.9, 6], [0, 0.1, 2.6]], 5, 7.3),
        (CLOSED, [[0, 0.1, 3.9, 4], [0, 0.1, 3.9, 4], [0, 0.1, 2.4, 2.5]], 6, 6.788),
        (DOOR, [[0, 20, 21, 40], [0, 0.1], [0, 2, 3]], 3, 11.8),
        (TABLE, [[0, 0.1, 0.2, 0.8, 0.9, 1], [0, 0.1, 0.2, 0.8, 0.9, 1], [0, 0.7, 0.75]], 5, 0.078),
    ],
    ids=["L", "walls", "thin walls", "room", "closed room", "door", "table"],
)
def test_things_with_flat_faces_are_divided_exactly(
    filled: NDArray[np.bool_], lines: list[list[float]], count: int, solid: float, turn: bool
) -> None:
    triangles = grid_mesh(filled, lines)
    parts = divide_mesh(turned(triangles) if turn else triangles)
    assert volume(parts) == pytest.approx(solid, rel=1e-4)
    assert len(parts.hulls) <= count + 3
    assert parts.deviation < 1e-3
    if not turn:
        centres = [[(a + b) / 2 for a, b in pairwise(x)] for x in lines]
        for cell in product(*(range(n) for n in filled.shape)):
            x, y, z = (centres[k][cell[k]] for k in range(3))
            assert inside(parts, (x, y, z)) == filled[cell]


@pytest.mark.slow
@given(st.integers(0, 2**27 - 1), st.integers(0, 2**31))
@example(3709, 0)  # a ring that touches itself along an edge
@settings(max_examples=25, deadline=None)
def test_what_a_mesh_encloses_is_what_its_parts_fill(pattern: int, seed: int) -> None:
    """Also where cells touch along an edge or at a corner only."""
    filled = np.array([pattern >> i & 1 for i in range(27)], dtype=bool).reshape(3, 3, 3)
    rng = np.random.default_rng(seed)
    lines = [np.cumsum(rng.integers(3, 10, 4) / 10).tolist() for _ in range(3)]
    if not filled.any():
        return
    parts = divide_mesh(grid_mesh(filled, lines))
    sizes = np.stack(np.meshgrid(*[np.diff(x) for x in lines], indexing="ij"))
    cells = sizes.prod(axis=0)
    solid = float(cells[filled].sum())
    assert volume(parts) == pytest.approx(solid, rel=1e-3)
    # No cell is as small as the tolerance, so each must be filled, or not, as it was.
    assert cells.min() > 1e-3 * solid
    # A cut may go through the middle of an edge, so the points lie elsewhere.
    within = [np.array(x[:-1]) + 0.43 * np.diff(x) for x in lines]
    for cell in product(range(3), repeat=3):
        x, y, z = (float(within[k][cell[k]]) for k in range(3))
        assert inside(parts, (x, y, z)) == filled[cell]


def test_walls_without_thickness_become_plates() -> None:
    box = trimesh.creation.box((4.0, 6.0, 2.5))
    walls = np.array(box.triangles)[np.abs(box.face_normals[:, 2]) < 0.5]
    parts = divide_mesh(walls)
    assert len(parts.hulls) == 4
    assert volume(parts) == pytest.approx(2 * (4 + 6) * 2.5 * 0.002)
    assert not inside(parts, (0, 0, 0))
    assert inside(parts, (2.0, 0, 0))


def test_a_box_without_its_bottom_is_a_box() -> None:
    box = trimesh.creation.box((4.0, 6.0, 2.5))
    parts = divide_mesh(np.array(box.triangles)[box.face_normals[:, 2] > -0.5])
    assert [hull.volume for hull in parts.hulls] == [pytest.approx(60.0)]


def test_a_flat_polygon_is_divided_into_convex_plates() -> None:
    parts = divide_mesh(grid_mesh(EL, [[0, 1, 3], [0, 1, 2], [0, 1]])[[0, 1]])
    assert len(parts.hulls) == 1
    el = np.array(
        [[[0, 0, 0], [3, 0, 0], [3, 1, 0]], [[0, 0, 0], [3, 1, 0], [1, 1, 0]]], dtype=float
    )
    rest = np.array(
        [[[0, 0, 0], [1, 1, 0], [1, 2, 0]], [[0, 0, 0], [1, 2, 0], [0, 2, 0]]], dtype=float
    )
    parts = divide_mesh(np.concatenate([el, rest]))
    assert 2 <= len(parts.hulls) <= 3
    assert volume(parts) == pytest.approx(4.0 * 0.002)
    assert not inside(parts, (2.0, 1.5, 0.0))


@pytest.mark.slow
@pytest.mark.parametrize("subdivisions", [3, 6])
def test_a_fine_sphere_keeps_few_corners(subdivisions: int) -> None:
    parts = divide_mesh(np.array(trimesh.creation.icosphere(subdivisions, 0.5).triangles))
    [hull] = parts.hulls
    assert len(hull.corners) <= MOST_CORNERS
    assert parts.deviation < 0.03
    assert np.linalg.norm(hull.corners, axis=1) == pytest.approx(0.5, abs=1e-3)


@pytest.mark.slow
def test_a_curved_solid_is_approximated_with_its_hollow() -> None:
    parts = divide_mesh(np.array(trimesh.creation.torus(0.5, 0.1).triangles))
    assert 6 <= len(parts.hulls) <= 64
    assert not inside(parts, (0.0, 0.0, 0.0), (0.3, 0.0, 0.0))
    assert inside(parts, (0.5, 0.0, 0.0))
    assert volume(parts) == pytest.approx(2 * np.pi**2 * 0.5 * 0.01, rel=0.15)


def test_the_leaves_of_a_tree_become_clumps() -> None:
    rng = np.random.default_rng(1)
    leaves = rng.uniform(-1, 1, (2000, 1, 3)) + rng.uniform(-0.02, 0.02, (2000, 3, 3))
    parts = divide_mesh(leaves)
    assert len(parts.hulls) <= 256
    assert parts.deviation < 0.5


@pytest.mark.parametrize("radius", [0.15, 0.25, 0.4])
def test_small_furniture_deviates_little_or_has_many_plates(radius: float) -> None:
    """A thin bowl, which is open and curved, so that its plates cannot be exact."""
    sphere = trimesh.creation.icosphere(subdivisions=4, radius=radius).triangles
    parts = divide_mesh(np.asarray(sphere[sphere[:, :, 2].max(axis=1) < 0.3 * radius]))
    assert parts.deviation <= TOLERANCE_M or 48 < len(parts.hulls) <= 128
    assert not parts.is_cut_short  # no limit of work, so nothing would be gained


@pytest.mark.slow
def test_a_mesh_with_many_uses_has_fewer_parts_and_they_fit_best_near_the_ground() -> None:
    trunk = grid_mesh(EL, [[0, 1, 3], [0, 1, 2], [0, 1]]) * [0.2, 0.2, 3.0]
    leaf = np.asarray(trimesh.creation.box((0.1, 0.1, 0.1)).triangles)
    places = np.random.default_rng(1).uniform((-3, -3, 2.5), (3, 3, 6), (400, 3))
    tree = np.concatenate([*(leaf + place for place in places), trunk])
    few, many = (divide_mesh(tree, 1e6, uses) for uses in (1, 30))
    assert len(few.hulls) > 400
    assert len(many.hulls) <= 71  # a quarter of the work, 120 units a part and use
    assert many.is_cut_short
    assert not inside(many, (0.5, 0.3, 1.0))  # the notch of the trunk
    assert inside(many, (0.1, 0.1, 1.0))


def test_the_limit_of_work_covers_reading_and_the_number_of_parts() -> None:
    post = np.asarray(trimesh.creation.box((0.1, 0.1, 1.0)).triangles)
    triangles = np.concatenate([post + np.array((0.4 * i, 0.0, 0.0)) for i in range(200)])
    whole = divide_mesh(triangles)
    limited = divide_mesh(triangles, 0.2 * whole.work)
    assert len(whole.hulls) == 200
    assert not whole.is_cut_short
    assert len(limited.hulls) < 60
    assert limited.is_cut_short
    assert limited.work < 0.3 * whole.work


def test_joined_corners_leave_no_face_without_area() -> None:
    """Two corners are joined in the middle of the line between the others of a face."""
    flat = [[0.05, 0.05, 0.0], [1.05, 0.09, 0.0], [2.05, 0.05, 0.0]]
    other = [[0.05, 0.05, 0.0], [1.05, 0.01, 0.0], [1.0, -1.0, 0.0]]
    joined, kept, _ = join_near(weld(np.array([flat, other])), 0.1)
    assert kept.tolist() == [1]
    assert find_normals(joined.triangles)[0, 2] != 0.0


def test_coarsening_ends_when_cells_exceed_the_surface(monkeypatch: pytest.MonkeyPatch) -> None:
    """Around the origin, cubes of any size leave a corner in each octant, so faces remain."""
    calls: list[float] = []

    def join(surface: Surface, cell: float) -> Any:
        calls.append(cell)
        return join_near(surface, cell)

    monkeypatch.setattr(mesh_parts, "join_near", join)
    ribbon = np.random.default_rng(1).uniform(-0.05, 0.05, (300, 3))
    divide_mesh(np.stack([ribbon[:-2], ribbon[1:-1], ribbon[2:]], axis=1))
    assert len(calls) > 5
    assert max(calls) < 0.2


def test_specks_are_left_out() -> None:
    box = np.array(trimesh.creation.box((1.0, 1.0, 1.0)).triangles)
    parts = divide_mesh(np.concatenate([box, box * 1e-4 + 3.0]))
    assert (len(parts.hulls), parts.dropped) == (1, 1)


def test_the_parts_are_the_same_each_time_and_mirrored_if_the_mesh_is() -> None:
    mesh = turned(grid_mesh(WALLS, [[0, 0.1, 3.9, 4], [0, 0.1, 5.9, 6], [0, 2.5]]))
    first, second = divide_mesh(mesh), divide_mesh(mesh)
    assert [h.corners.tolist() for h in first.hulls] == [h.corners.tolist() for h in second.hulls]
    mirrored = divide_mesh(mesh[:, ::-1] * [-1.0, 1.0, 1.0])
    assert volume(mirrored) == pytest.approx(volume(first), rel=1e-6)
    assert len(mirrored.hulls) == len(first.hulls)


@pytest.mark.parametrize(("level", "false"), [(0.0, 0.0), (0.5, 2.0)])
def test_only_the_inside_of_a_box_that_is_open_above_is_false_area(
    level: float, false: float
) -> None:
    """Nothing gets into a terrace that is drawn without its underside; a tub is open."""
    box = trimesh.creation.box(bounds=((-1.0, -0.5, 0.0), (1.0, 0.5, 0.5)))
    triangles = np.asarray(box.triangles)
    surface = weld(triangles[(triangles[:, :, 2] != level).any(axis=1)])
    sections = compare_sections(surface, [surface.points], [0.1, 0.3])
    assert sections.false == pytest.approx(false, rel=0.1)
    assert sections.missed == pytest.approx(0.0, abs=1e-6)
