"""The SDF writer: what it writes, the reader reads again."""

import math

import numpy as np
import pytest
from field_cases import (
    course,
)
from hypothesis import given
from hypothesis import strategies as st

from evoros.formats.sdf.reader import read_sdf
from evoros.formats.sdf.writer import write_sdf
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.world.loading import load_world


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


def assert_alike(bodies: tuple[Body, ...], others: tuple[Body, ...]) -> None:
    for one, other in zip(bodies, others, strict=True):
        assert (one.name, one.mass, one.friction) == (other.name, other.mass, other.friction)
        np.testing.assert_allclose(one.pose.position, other.pose.position, atol=1e-9)
        np.testing.assert_allclose(one.pose.rotation, other.pose.rotation, atol=1e-8)
        for shape, another in zip(one.shapes, other.shapes, strict=True):
            assert shape.kind == another.kind
            assert shape.size == pytest.approx(another.size, abs=1e-9)
        assert (one.inertia or ()) == pytest.approx(other.inertia or ())
