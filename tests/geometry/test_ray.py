"""The tests that exclude a box before rays are cast never exclude one that a ray hits."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from evoros.base.arrays import Array
from evoros.geometry.ray import (
    AT_X,
    BOX,
    EXTENT,
    KIND,
    OBSTACLE_SIZE,
    ROTATION,
    cast_rays,
    is_beside,
    is_beyond,
    turn_frame,
)
from evoros.geometry.shapes import Pose

ANGLES = st.floats(-math.pi, math.pi)
NO_FACES = np.zeros((0, 4))


@st.composite
def boxes(draw: st.DrawFn, upright: bool = False) -> Array:
    """A box at the origin of the world, turned in any way, or about the vertical."""
    row = np.zeros(OBSTACLE_SIZE)
    row[KIND] = BOX
    row[AT_X : AT_X + 3] = 0.0
    roll, pitch = (0.0, 0.0) if upright else (draw(ANGLES), draw(ANGLES))
    pose = Pose.from_rpy((0.0, 0.0, 0.0), roll, pitch, draw(ANGLES))
    row[ROTATION : ROTATION + 9] = pose.rotation.ravel()
    row[EXTENT : EXTENT + 3] = [draw(st.floats(0.01, 3.0)) for _ in range(3)]
    return row


@st.composite
def rays(draw: st.DrawFn) -> Array:
    """A ray (1, 3), a unit vector."""
    yaw, pitch = draw(ANGLES), draw(st.floats(-1.5, 1.5))
    level = math.cos(pitch)
    return np.array([[level * math.cos(yaw), level * math.sin(yaw), math.sin(pitch)]])


@st.composite
def hits(draw: st.DrawFn) -> tuple[Array, Array, float, tuple[float, float, float]]:
    """A box, a ray from outside that meets it, the heading, and the box's centre."""
    box, ray, heading = draw(boxes()), draw(rays()), draw(ANGLES)
    half = box[EXTENT : EXTENT + 3]
    # The ray passes the centre at less than the shortest half length, and begins outside.
    aside = draw(st.tuples(*[st.floats(-0.5, 0.5)] * 3))
    distance = float(np.linalg.norm(half)) + draw(st.floats(0.1, 8.0))
    x, y, z = (distance * ray[0] + float(half.min()) * np.array(aside)).tolist()
    return box, ray, heading, (x, y, z)


def cast(box: Array, heading: float, centre: tuple[float, float, float], ray: Array) -> float:
    """Return the distance to a box whose centre is at ``centre`` from the ray's origin."""
    frame = turn_frame(box, math.cos(heading), math.sin(heading))
    x, y, z = centre
    return cast_rays(box, NO_FACES, frame, (-x, -y, -z), ray, math.inf, np.zeros(0))


@given(hits())
def test_a_box_that_is_hit_is_not_beyond_the_hit(
    hit: tuple[Array, Array, float, tuple[float, float, float]],
) -> None:
    box, ray, heading, centre = hit
    distance = cast(box, heading, centre, ray)
    assert math.isfinite(distance)
    frame = turn_frame(box, math.cos(heading), math.sin(heading))
    assert not is_beyond(box, frame, centre, distance)


@given(hits(), ANGLES)
def test_a_box_that_is_hit_is_not_beside_a_plane_that_the_ray_is_behind(
    hit: tuple[Array, Array, float, tuple[float, float, float]], turn: float
) -> None:
    box, ray, heading, (x, y, _) = hit
    across, along = math.cos(turn), math.sin(turn)
    if ray[0, 0] * across + ray[0, 1] * along > 0.0:
        across, along = -across, -along
    frame = turn_frame(box, math.cos(heading), math.sin(heading))
    assert not is_beside(box, frame, x, y, across, along)


@given(boxes(upright=True), ANGLES, st.floats(0.0, 2.0 * math.pi))
def test_a_distant_box_is_beyond_and_beside(box: Array, heading: float, turn: float) -> None:
    frame = turn_frame(box, math.cos(heading), math.sin(heading))
    x, y = 20.0 * math.cos(turn), 20.0 * math.sin(turn)
    assert is_beside(box, frame, x, y, math.cos(turn), math.sin(turn))
    # Its corners are within 3 sqrt(3) m of its centre, 5.2 m.
    assert is_beyond(box, frame, (x, y, 0.0), 5.0)


@given(boxes(), rays(), ANGLES, st.tuples(*[st.floats(-6.0, 6.0)] * 3), st.floats(0.0, 8.0))
def test_a_hit_counts_if_it_is_nearer_than_the_best(
    box: Array, ray: Array, heading: float, centre: tuple[float, float, float], best: float
) -> None:
    """Rays that fall short of the best are not intersected, and must not have counted."""
    frame = turn_frame(box, math.cos(heading), math.sin(heading))
    origin = (-centre[0], -centre[1], -centre[2])
    nearest = cast_rays(box, NO_FACES, frame, origin, ray, best, np.zeros(0))
    assert nearest == min(best, cast(box, heading, centre, ray))
