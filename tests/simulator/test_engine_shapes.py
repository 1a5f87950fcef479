"""Polyhedra and height fields in all simulators, against each other and known heights."""

import math
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from planar_cases import rock
from pybullet_cases import beam, level, mount_sensors, short_experiment
from rigid_cases import ENGINES, Rigid, attitude, probe, ranges

from evoros.base.arrays import CONTACT, STATE_SIZE, YAW, X, Y
from evoros.base.errors import InputError
from evoros.certificate.confirmation import Confirmation
from evoros.evolution.experiment import Experiment
from evoros.geometry.polyhedron import joint_moments
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.simulator.mujoco import Mujoco
from evoros.simulator.planar import Planar
from evoros.simulator.protocol import open_alone
from evoros.simulator.pybullet import PyBullet
from evoros.world.floors import ground_height
from evoros.world.model import World
from evoros.world.standing import standing_obstacles

pytestmark = pytest.mark.usefixtures("closed_engines")

MARGIN_M = 0.002  # PyBullet's own for movable polyhedra is 1 mm

AROUND = [(0.2 * math.cos(t), 0.2 * math.sin(t), 0.2, math.degrees(t), 0.0) for t in range(6)]


@cache
def experiment() -> Experiment:
    return short_experiment()


@pytest.fixture(params=ENGINES)
def engine(request: pytest.FixtureRequest) -> Any:
    return request.param


def corners_of_box(x: float, y: float, z: float) -> Shape:
    half = (x / 2, y / 2, z / 2)
    corners = [(a * half[0], b * half[1], c * half[2])
               for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)]  # fmt: skip
    return Shape("convex", (), corners=tuple(corners))


@pytest.mark.slow
@settings(deadline=None, max_examples=12)
@given(st.lists(st.integers(0, 2**32), min_size=1, max_size=4), st.sampled_from([None, 5.0]))
def test_all_simulators_see_the_same_surfaces(seeds: list[int], mass: float | None) -> None:
    """PyBullet's are at most the margin farther out, in a body of several parts, too."""
    rng = np.random.default_rng(seeds[0])
    shapes = tuple(
        replace(rock(seed), pose=Pose.from_rpy((0.0, 0.3 * i, 0.1), *rng.uniform(-3, 3, 3)))
        for i, seed in enumerate(seeds)
    )
    pose = Pose((2.2, float(rng.uniform(-0.5, 0.5)), 0.3))
    inertia = None if mass is None else (1.0, 1.0, 1.0)
    (body,) = standing_obstacles(
        level(experiment(), Body("rock", pose, shapes, mass, 1.0, inertia))
    )
    world = level(experiment(), body)  # a movable one stands already, and does not fall
    robot = mount_sensors(experiment(), beam(), *AROUND)
    plane, bullet, exact = (
        ranges(simulator, robot, world) for simulator in (Planar(), PyBullet(), Mujoco())
    )
    grown = level(experiment(), replace(body, shapes=tuple(map(grow, shapes))))
    nearest = ranges(Planar(), robot, grown)
    assert (bullet <= plane + 1e-4).all()
    assert (bullet >= nearest - 1e-4).all()
    assert np.abs(exact - plane).max() < 1e-6


def grow(shape: Shape) -> Shape:
    """The polyhedron with each corner outwards, so that it holds all within the margin."""
    corners = np.array(shape.corners)
    steps = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)]) * MARGIN_M
    points = (corners[:, None] + steps).reshape(-1, 3)
    return replace(shape, corners=tuple((x, y, z) for x, y, z in points.tolist()))


def test_a_wedge_is_seen_at_the_height_of_the_beam(engine: type[Rigid]) -> None:
    """A ramp that begins 1 m ahead and is 1 m high 2 m ahead."""
    corners = tuple((x, y, z) for y in (-1.0, 1.0) for x, z in ((1, 0), (2, 0), (2, 1)))
    world = level(experiment(), Body("ramp", Pose(), (Shape("convex", (), corners=corners),)))
    robot = mount_sensors(experiment(), beam(), (0.2, 0.0, 0.15, 0.0, 0.0))
    assert ranges(Planar(), robot, world) == pytest.approx([0.95])
    assert ranges(engine(), robot, world) == pytest.approx([0.95], abs=3e-4)


def test_a_floor_of_a_mesh_is_seen_where_it_is(engine: type[Rigid]) -> None:
    """A slab with its top at 0; a ray from 0.15 m that descends by 2.5 deg ends 3.435 m away."""
    slab = Body("slab", Pose((0.0, 0.0, -0.5)), (corners_of_box(30.0, 30.0, 1.0),), floor=True)
    world = uneven(slab)
    robot = mount_sensors(experiment(), beam(), (0.2, 0.0, 0.15, 0.0, -2.5))
    expected = 0.15 / math.sin(math.radians(2.5))
    assert ranges(Planar(), robot, world) == pytest.approx([expected])
    assert ranges(engine(), robot, world) == pytest.approx([expected], abs=0.003)
    state = np.zeros(STATE_SIZE)
    with open_alone(engine().open, experiment().robot, world) as simulation:
        for _ in range(20):
            simulation.advance(np.array([0.3, 0.3]), 0.5)
            simulation.observe(state)
            assert not state[CONTACT]
        z, _, _ = attitude(simulation)
    assert abs(z) < 0.002


@pytest.mark.parametrize("kind", [Planar, *ENGINES])
def test_a_polyhedron_stops_the_robot(kind: type[Planar | Rigid]) -> None:
    """The front is 0.25 m ahead of the base frame, the block 1 m."""
    block = Body("block", Pose((1.5, 0.0, 0.5)), (corners_of_box(1.0, 1.0, 1.0),))
    state, touched = np.zeros(STATE_SIZE), []
    with open_alone(kind().open, experiment().robot, level(experiment(), block)) as simulation:
        for _ in range(40):
            simulation.advance(np.array([0.3, 0.0]), 0.1)
            simulation.observe(state)
            touched.append((state[X], bool(state[CONTACT])))
    first = next(x for x, contact in touched if contact)
    assert first == pytest.approx(0.75, abs=0.01)
    assert max(x for x, _ in touched) < 0.76


def test_a_polyhedron_weighs_as_the_box_that_it_is(engine: type[Rigid]) -> None:
    """PyBullet alone would take the moments of the box around the shape, with its margin."""
    solid = replace(corners_of_box(0.3, 0.4, 0.2), pose=Pose((0.0, 0.0, 0.0)))
    body = Body("block", Pose((2.0, 0.0, 0.1)), (solid,), mass=3.0)
    with open_alone(engine().open, experiment().robot, level(experiment(), body)) as simulation:
        moments = probe(simulation).moments()
    expected = (3 / 12 * (0.16 + 0.04), 3 / 12 * (0.09 + 0.04), 3 / 12 * (0.09 + 0.16))
    assert moments == pytest.approx(expected, rel=1e-6)
    assert joint_moments((solid,), 3.0) == pytest.approx(expected, rel=1e-6)


# Ground that is not level.


def hills(rng: np.random.Generator, x: float = 0.0, y: float = 0.0, yaw: float = 0.0) -> Body:
    """A field of 5 columns and 4 rows, 8 m by 6 m, whose height is 0 at the world's origin."""
    heights = rng.uniform(-0.5, 0.5, (4, 5))
    pose = Pose.from_rpy((x, y, 0.0), 0.0, 0.0, yaw)
    field = Shape("heightfield", (8.0, 6.0), heights=tuple(map(tuple, heights.tolist())))
    z = ground_height((Body("f", pose, (field,)),), (0.0, 0.0))
    assert z is not None
    return Body("field", Pose((x, y, -z), pose.quaternion), (field,))


def uneven(*bodies: Body) -> World:
    world = experiment().world["boxes"]
    course = replace(world.course, home_x_m=0.0, home_y_m=0.0, home_yaw_rad=0.0, home_z_m=0.0)
    return replace(world, bodies=bodies, course=course)


@pytest.mark.parametrize(("x", "y", "yaw"), [(0.0, 0.0, 0.0), (1.0, -0.5, 0.0), (0.3, 0.2, 0.7)])
def test_a_height_field_is_where_its_heights_are(
    engine: type[Rigid], x: float, y: float, yaw: float
) -> None:
    """Row i from -y, column j from -x: every grid point, whatever the mean of the heights."""
    body = hills(np.random.default_rng(3), x, y, yaw)
    (field,) = body.shapes
    with open_alone(engine().open, experiment().robot, uneven(body)) as simulation:
        for i, row in enumerate(field.heights):
            for j, height in enumerate(row):
                inside = 0.999999  # the outermost points are on the edge
                point = (inside * (8 * j / 4 - 4), inside * (6 * i / 3 - 3), height)
                px, py, pz = body.pose.transform(point)
                assert probe(simulation).height(px, py) == pytest.approx(pz, abs=1e-4)


def test_a_robot_is_set_down_on_a_slope_and_stays(engine: type[Rigid]) -> None:
    """A plane that rises by 0.1 rad along x: the robot stands on it, tilted as it is."""
    slope = Body("slope", Pose.from_rpy((0.0, 0.0, 0.0), 0.0, -0.1, 0.0), level_plane())
    state, tilt = np.zeros(STATE_SIZE), -math.degrees(0.1)
    with open_alone(engine().open, experiment().robot, uneven(slope)) as simulation:
        assert attitude(simulation)[2] == pytest.approx(tilt, abs=1e-4)
        simulation.advance(np.zeros(2), 1.0)
        assert attitude(simulation)[2] == pytest.approx(tilt, abs=0.6)
        simulation.observe(state)
        assert abs(state[X]) < 0.02
        simulation.advance(np.array([0.3, 0.0]), 3.0)
        simulation.observe(state)
        assert state[X] == pytest.approx(0.9 * math.cos(0.1), abs=0.05)
        assert not state[CONTACT]
        z, _, _ = attitude(simulation)
        assert z == pytest.approx(state[X] * math.tan(0.1), abs=0.01)


def test_a_robot_drives_over_a_height_field(engine: type[Rigid]) -> None:
    """The same slope as a height field, at the middle of which the robot is set down."""
    edge = 4.0 * math.tan(0.1)
    field = Shape("heightfield", (8.0, 6.0), heights=((-edge, edge), (-edge, edge)))
    state = np.zeros(STATE_SIZE)
    with open_alone(
        engine().open, experiment().robot, uneven(Body("f", Pose(), (field,)))
    ) as simulation:
        simulation.advance(np.array([0.3, 0.0]), 3.0)
        simulation.observe(state)
        z, _, _ = attitude(simulation)
    assert state[X] == pytest.approx(0.9 * math.cos(0.1), abs=0.05)
    assert (abs(state[Y]) < 0.02, abs(state[YAW]) < 0.05, state[CONTACT]) == (True, True, 0.0)
    assert z == pytest.approx(state[X] * math.tan(0.1), abs=0.01)


def test_a_robot_climbs_a_ramp_made_of_a_body(engine: type[Rigid]) -> None:
    """A wedge that begins 0.5 m ahead and rises by 0.1 rad; it is floor, no obstacle."""
    top = 2.0 * math.tan(0.1)
    corners = tuple((x, y, z) for y in (-1.0, 1.0) for x, z in ((0.5, 0), (2.5, 0), (2.5, top)))
    ramp = Body("ramp", Pose(), (Shape("convex", (), corners=corners),), floor=True)
    state = np.zeros(STATE_SIZE)
    with open_alone(engine().open, experiment().robot, level(experiment(), ramp)) as simulation:
        simulation.advance(np.array([0.3, 0.0]), 5.0)
        simulation.observe(state)
        z, _, tilt = attitude(simulation)
    assert (1.4 < state[X] < 1.5, abs(state[Y]) < 0.02, state[CONTACT]) == (True, True, 0.0)
    assert tilt == pytest.approx(-math.degrees(0.1), abs=0.6)
    assert z == pytest.approx((state[X] - 0.5) * math.tan(0.1), abs=0.01)


@pytest.mark.parametrize("kind", [Planar, *ENGINES])
@pytest.mark.parametrize(("clear", "ahead"), [(0.25, 4.5), (0.17, 0.8)])
def test_a_robot_passes_under_a_table_that_is_high_enough(
    kind: type[Planar | Rigid], clear: float, ahead: float
) -> None:
    """It is 0.19 m high, 0.25 m behind its front; in the plane it is so high everywhere."""
    legs = [(Pose((x, y, clear / 2)), Shape("box", (0.05, 0.05, clear)))
            for x in (-0.5, 0.5) for y in (-0.6, 0.6)]  # fmt: skip
    parts = [(Pose((0.0, 0.0, clear + 0.05)), Shape("box", (1.05, 1.25, 0.1))), *legs]
    shapes = tuple(replace(shape, pose=pose) for pose, shape in parts)
    world = level(experiment(), Body("table", Pose((1.525, 0.0, 0.0)), shapes))
    robot = mount_sensors(experiment(), beam(), (0.2, 0.0, 0.18, 0.0, 0.0))
    assert ranges(kind(), robot, world) == pytest.approx([ahead], abs=1e-3)
    state = np.zeros(STATE_SIZE)
    with open_alone(kind().open, robot, world) as simulation:
        simulation.advance(np.array([0.3, 0.0]), 8.0)
        simulation.observe(state)
    assert bool(state[CONTACT]) == (clear < 0.19)
    stop = 0.75 if kind is Planar else 1.01
    assert state[X] == pytest.approx(2.4 if clear > 0.19 else stop, abs=0.06)


def level_plane() -> tuple[Shape, ...]:
    return (Shape("plane", (0.0, 0.0, 1.0)),)


@pytest.mark.parametrize(
    "ground",
    [
        Body("slope", Pose.from_rpy((0.0, 0.0, 0.0), 0.0, -0.1, 0.0), level_plane()),
        Body("f", Pose(), (Shape("heightfield", (9.0, 9.0), heights=((0.0, 0.0),) * 2),)),
    ],
)
def test_the_plane_refuses_ground_that_is_not_level(ground: Body) -> None:
    worlds = {"hills": uneven(ground)}
    with pytest.raises(InputError, match=r"^world\.hills: the ground is a height field.*=physics$"):
        replace(experiment(), simulator=Planar(), world=worlds)
    physical = replace(experiment(), simulator=PyBullet(), world=worlds)
    with pytest.raises(InputError, match=r"^confirmation\.simulator: world\.hills: "):
        replace(physical, confirmation=Confirmation(Planar()))
