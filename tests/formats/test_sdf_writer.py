"""The SDF writer: what it writes, the reader reads again."""

import math
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from field_cases import course
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from evoros.base.arrays import Array
from evoros.formats.sdf.reader import read_sdf
from evoros.formats.sdf.writer import write_sdf
from evoros.geometry.footprint import height_points
from evoros.geometry.polyhedron import placed_corners
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.world.floors import GROUND
from evoros.world.loading import load_world
from evoros.world.model import World


@pytest.mark.parametrize("name", ["boxes", "maze", "blocks"])
def test_the_bundled_worlds_survive_being_written(name: str) -> None:
    world = load_world(f"{name}.sdf", course())
    again = read_sdf(world.sdf.encode(), "written").bodies
    assert_alike(world.bodies, again)


angles = st.floats(-math.pi, math.pi)


@given(st.lists(st.tuples(angles, angles, angles, st.booleans()), min_size=1, max_size=3))
def test_any_pose_survives_being_written(turns: list[tuple[float, float, float, bool]]) -> None:
    bodies = tuple(
        Body(
            f"body{i}",
            Pose.from_rpy((1.25, -3.5, 1e-3 * i), roll, pitch, yaw),
            (Shape("box", (0.1, 0.2, 0.3)),),
            4.0 if movable else None,
            0.7,
            (0.1, 0.2, 0.25) if movable else None,
        )
        for i, (roll, pitch, yaw, movable) in enumerate(turns)
    )
    assert_alike(bodies, read_sdf(write_sdf("x", bodies).encode(), "x").bodies)


def test_straight_up_and_down_survive_being_written() -> None:
    for pitch in (math.pi / 2, -math.pi / 2):
        body = Body(
            "b", Pose.from_rpy((0, 0, 1), 0.3, pitch, 0.9), (Shape("cylinder", (0.1, 2.0)),)
        )
        assert_alike((body,), read_sdf(write_sdf("x", (body,)).encode(), "x").bodies)


def written(folder: Path, *bodies: Body) -> tuple[Body, ...]:
    """Bodies after they were written into a folder and read from it."""
    files = World("w", (GROUND, *bodies), course(), "w.sdf", "0").files("some world")
    for name, content in files.items():
        (folder / name).write_bytes(content)
    path = folder / "some world.sdf"
    ground, *others = read_sdf(path.read_bytes(), "some world.sdf", file=path).bodies
    assert ground.is_ground
    return tuple(others)


def rock(seed: int) -> Shape:
    """A part of 5 to 14 corners, in a pose of its own."""
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-0.5, 0.5, 3) + rng.uniform(-1.0, 1.0, (rng.integers(5, 15), 3))
    pose = Pose.from_rpy((0.5, -1.0, 0.25), *rng.uniform(-3.0, 3.0, 3))
    hull = corners[ConvexHull(corners).vertices]
    return Shape("convex", (), pose, tuple((x, y, z) for x, y, z in hull.tolist()))


@settings(deadline=None, max_examples=20)
@given(st.lists(st.integers(0, 2**32), min_size=1, max_size=3), angles)
def test_polyhedra_survive_being_written(seeds: list[int], yaw: float) -> None:
    pose = Pose.from_rpy((1.25, -3.5, 20.0), 0.3, 0.2, yaw)
    shapes = tuple(map(rock, seeds))
    movable = Body("movable", pose, shapes, 4.0, 0.7, (0.1, 0.2, 0.25))
    fixed = Body("fixed", Pose((9.0, 9.0, 20.0)), (replace(shapes[0], pose=Pose()),))
    with TemporaryDirectory() as folder:
        again = written(Path(folder), movable, fixed)
    assert_alike((movable, fixed), again)
    for one, other in zip((movable, fixed), again, strict=True):
        for shape, another in zip(one.shapes, other.shapes, strict=True):
            found, expected = sorted(another.corners), sorted(shape.corners)
            np.testing.assert_allclose(found, expected, atol=1e-7)  # as meshes are rounded


def test_a_height_field_survives_being_written(tmp_path: Path) -> None:
    """Heights within half a 65535th of their range, below and above 0, row 0 at -y."""
    rng = np.random.default_rng(1)
    rows = tuple(map(tuple, rng.uniform(-2.0, 5.0, (5, 9)).tolist()))
    field = Body(
        "field", Pose((51.0, 2.0, 0.5)), (Shape("heightfield", (16.0, 8.0), heights=rows),)
    )
    flat = Body(
        "flat",
        Pose((70.0, 0.0, 0.0)),
        (Shape("heightfield", (3.0, 2.0), heights=((0.5, 0.5),) * 2),),
    )
    again = written(tmp_path, field, flat)
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "some world.sdf",
        "some world_1.png",
        "some world_2.png",
    ]
    for one, other in zip((field, flat), again, strict=True):
        np.testing.assert_allclose(points(other), points(one), atol=7.0 / 65535)


def points(body: Body) -> Array:
    """The grid points of a field in the world."""
    (shape,) = body.shapes
    pose = body.pose @ shape.pose
    return placed_corners(height_points(shape).reshape(-1, 3), pose.rotation, pose.position)


def test_gravity_and_a_slope_survive_being_written() -> None:
    slope = Body("slope", Pose.from_rpy((0, 0, 0), 0.0, -0.1, 0.0), GROUND.shapes)
    moon = World("moon", (slope,), course(), "moon.sdf", "0", gravity_mps2=1.62)
    again = read_sdf(moon.sdf.encode(), "moon.sdf")
    assert again.gravity_mps2 == 1.62
    assert_alike((slope,), again.bodies)
    assert "gravity" not in replace(moon, gravity_mps2=9.81).sdf


def assert_alike(bodies: tuple[Body, ...], others: tuple[Body, ...]) -> None:
    for one, other in zip(bodies, others, strict=True):
        assert (one.name, one.mass, one.friction) == (other.name, other.mass, other.friction)
        np.testing.assert_allclose(one.pose.position, other.pose.position, atol=1e-9)
        np.testing.assert_allclose(one.pose.rotation, other.pose.rotation, atol=1e-8)
        for shape, another in zip(one.shapes, other.shapes, strict=True):
            assert shape.kind == another.kind
            assert shape.size == pytest.approx(another.size, abs=1e-9)
        assert (one.inertia or ()) == pytest.approx(other.inertia or ())
