"""Robots push movable bodies in the plane by the stated law; nothing passes through anything."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from planar_cases import experiment, rover
from pybullet_cases import box, level

from evoros.base.arrays import CONTACT, STATE_SIZE, YAW, Array, X, Y
from evoros.base.packing import unpack
from evoros.compilation.rules import ADVANCE, SENSE, compile_rule
from evoros.geometry.polygon import polygon_contact
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.robot.model import Robot
from evoros.simulator.engines.planar_bodies import ARM_SQUARED, LOAD, Movables, Placed
from evoros.simulator.engines.planar_layout import Memory, Plane
from evoros.simulator.engines.planar_pushing import Push, move_body
from evoros.simulator.engines.planar_rules import advance_pushing
from evoros.simulator.engines.planar_sensing import sense
from evoros.simulator.planar import Planar
from evoros.simulator.protocol import open_alone
from evoros.simulator.pybullet import PyBullet
from evoros.world.model import World

FRONT_M = 0.25  # of the rover, ahead of its origin


def world_with(*obstacles: Body) -> World:
    """Level ground on which missions go on after contact."""
    world = level(experiment(), *obstacles)
    return replace(world, course=replace(world.course, end_on_collision=False))


def crate(x: float, y: float = 0.0, mass: float = 1.0, friction: float = 0.3) -> Body:
    size = (0.4, 0.4, 0.4)
    return replace(box(f"crate {x} {y}", x, y, size, mass), friction=friction)


def barrel(x: float, y: float = 0.0, mass: float = 1.0) -> Body:
    shape = (Shape("cylinder", (0.2, 0.4)),)
    return Body(f"barrel {x} {y}", Pose((x, y, 0.2)), shape, mass, 0.3)


class Mission:
    """A mission in the plane, step by step."""

    def __init__(self, world: World, robot: Robot | None = None, compiled: bool = True) -> None:
        self.robot = robot or rover()
        with open_alone(Planar(steering_lag_s=0.0).open, self.robot, world) as simulation:
            self.parameters, self.memory = simulation.parameters, simulation.memory
        self._drive = compile_rule(advance_pushing, ADVANCE) if compiled else advance_pushing
        self.motion = unpack(Memory, self.memory).motions[0]
        self.movables = unpack(Movables, unpack(Plane, self.parameters).movables)
        self.placed = unpack(Placed, unpack(Memory, self.memory).movables)

    def drive(self, speed: float, steering: float = 0.0, duration: float = 0.1) -> "Mission":
        self.motion[CONTACT] = 0.0
        self._drive(self.parameters, self.memory, np.array([speed, steering]), duration)
        return self

    @property
    def poses(self) -> Array:
        """The centres of mass [m] and the turns [rad] of the bodies (b, 3)."""
        x, y, cos, sin = self.placed.poses.T
        return np.column_stack([x, y, np.arctan2(sin, cos)])

    def polygons(self) -> list[tuple[Array, float]]:
        """The robot, the bodies, then the obstacles that stay; with what surrounds each."""
        x, y, yaw = self.motion[[X, Y, YAW]]
        cos, sin = math.cos(yaw), math.sin(yaw)
        robot = self.robot.outline @ np.array([[cos, sin], [-sin, cos]]) + (x, y)
        corners, still = self.placed.corners, self.movables.fixed_corners
        return [
            (robot, 0.0),
            *((corners[int(p[1]) : int(p[2])], float(p[0])) for p in self.movables.parts),
            *((still[int(f[4]) : int(f[5])], float(f[3])) for f in self.movables.fixed),
        ]


def deepest(polygons: Sequence[tuple[Array, float]]) -> float:
    """The deepest overlap [m] of any two."""
    return max(
        polygon_contact(a, b, ra, rb)[0]
        for i, (a, ra) in enumerate(polygons)
        for b, rb in polygons[:i]
    )


def test_a_box_that_is_hit_in_the_middle_goes_straight_ahead() -> None:
    """It lies against the front of the rover, and the rover keeps its speed and reports contact."""
    plane = Mission(world_with(crate(1.0))).drive(0.3, duration=4.0)
    x, y, turn = plane.poses[0]
    assert plane.motion[X] == pytest.approx(1.2)
    assert x == pytest.approx(1.2 + FRONT_M + 0.2, abs=1e-4)
    assert (y, turn) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert plane.motion[CONTACT] == 1.0
    plane.drive(-0.3, duration=1.0)
    assert plane.poses[0] == pytest.approx([x, y, turn], abs=1e-9)
    assert plane.drive(-0.3).motion[CONTACT] == 0.0


@pytest.mark.parametrize("friction", [1.0, 0.1, 0.0])
def test_a_contact_moves_a_body_by_the_limit_surface(friction: float) -> None:
    """In closed form, after Lynch, Maekawa and Tanie (1992), for a contact that sticks.

    It slides with 0.1, where the force is on the edge of the friction cone.
    """
    plane, depth, lever, arm = Mission(world_with(crate(3.0))), 1e-3, 0.1, 0.2
    square = plane.movables.bodies[0, ARM_SQUARED]
    assert square == pytest.approx(2 * 0.2**2)  # the corners carry it
    place = (3.0 - arm, -lever)
    move_body(plane.movables, plane.placed, 0, Push(depth, 1.0, 0.0, *place, 0.0, friction))
    x, y, turn = plane.poses[0] - (3.0, 0.0, 0.0)
    if friction == 1.0:
        whole = square + arm * arm + lever * lever
        assert x == pytest.approx(depth * (square + arm * arm) / whole)
        assert y == pytest.approx(depth * arm * lever / whole)
        assert turn == pytest.approx(depth * lever / whole)
    else:
        force = depth / (1 + (lever * lever + friction * lever * -arm) / square)
        assert x == pytest.approx(force)
        assert y == pytest.approx(friction * force)
        assert turn == pytest.approx(force * (lever - friction * arm) / square)
    # The point of contact moved by the depth along the normal.
    assert x - turn * -lever == pytest.approx(depth)


def test_a_body_between_rover_and_wall_stops_it() -> None:
    """So does a chain of two; the chain moves until the last one is at the wall."""
    wall = box("wall", 2.1, size=(0.2, 9.0, 0.5))
    plane = Mission(world_with(crate(0.8), barrel(1.3), wall)).drive(0.3, duration=6.0)
    ahead = 2.0 - 0.4 - 0.4 - FRONT_M
    assert 0.0 <= ahead - plane.motion[X] < 0.3 * 0.02 + 1e-3
    assert plane.motion[CONTACT] == 1.0
    assert deepest(plane.polygons()) < 1e-4
    before = plane.motion.copy()
    plane.drive(0.3, duration=1.0)
    assert plane.motion[[X, Y, YAW]] == pytest.approx(before[[X, Y, YAW]], abs=0.0)


def test_a_robot_pushes_as_much_friction_as_its_weight_has() -> None:
    """The rover weighs 3.5 kg and its sensors."""
    weight = Mission(world_with(crate(1.0))).movables.bodies[0]
    assert weight[LOAD] == pytest.approx(0.3)
    for mass, friction, moves in ((11.0, 0.3, True), (12.5, 0.3, False), (5.0, 0.7, True)):
        plane = Mission(world_with(crate(1.0, 0.0, mass, friction))).drive(0.3, duration=4.0)
        assert bool(plane.poses[0, 0] > 1.5) is moves
        assert bool(plane.motion[X] > 1.0) is moves
    two = world_with(crate(1.0, 0.0, 6.0), crate(1.5, 0.0, 6.0))
    plane = Mission(two).drive(0.3, duration=4.0)
    assert plane.poses[:, 0] == pytest.approx([1.1, 1.5], abs=0.01)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_nothing_overlaps_wherever_a_rover_drives(seed: int) -> None:
    rng = np.random.default_rng(seed)
    obstacles: list[Body] = []
    for i, (x, y, yaw) in enumerate(rng.uniform((-2.5, -2.5, -3), (2.5, 2.5, 3), (40, 3))):
        if math.hypot(x, y) < 0.8 or any(
            math.dist((x, y), other.pose.position[:2]) < 0.62 for other in obstacles
        ):
            continue
        shape = Shape("box", (0.4, 0.4, 0.4)) if i % 3 else Shape("cylinder", (0.2, 0.4))
        pose = Pose.from_rpy((float(x), float(y), 0.2), 0.0, 0.0, float(yaw))
        obstacles.append(Body(str(i), pose, (shape,), 0.2 if i % 4 else None, 0.5))
    plane = Mission(world_with(*obstacles))
    start = plane.poses
    for _ in range(100):
        plane.drive(float(rng.choice([-0.3, 0.3])), float(rng.uniform(-0.6, 0.6)), 0.8)
        assert deepest(plane.polygons()) < 1e-3
    assert np.abs(plane.poses - start).max() > 0.2
    assert np.isfinite(plane.memory).all()


def test_compiled_and_interpreted_missions_have_the_same_bits() -> None:
    world = world_with(crate(0.8, 0.15), barrel(1.3, 0.1), box("wall", 1.9, size=(0.2, 1.0, 0.5)))
    robot = rover((0.2, 0.0, 0.166, 0.0, 0.0))
    planes = Mission(world, robot), Mission(world, robot, compiled=False)
    ranges = np.zeros((2, 1))
    for plane in planes:
        plane.motion[X] = 0.3
    for tick in range(14):
        for plane in planes:
            plane.drive(0.3, 0.4 * math.sin(tick))
        assert planes[0].memory.tobytes() == planes[1].memory.tobytes()
    compile_rule(sense, SENSE)(planes[0].parameters, planes[0].memory, ranges[0])
    sense(planes[1].parameters, planes[1].memory, ranges[1])
    assert ranges[0] == ranges[1]


def test_sensors_see_a_body_where_it_is() -> None:
    """Before contact, and then in front of the rover, which pushes it."""
    robot = rover((0.1, 0.0, 0.166, 0.0, 0.0), fov_deg=1.0, rays_per_axis=1)
    plane, ranges = Mission(world_with(crate(0.9)), robot), np.zeros(1)
    readings = []
    for _ in range(3):
        sense(plane.parameters, plane.memory, ranges)
        readings.append(float(ranges[0]))
        plane.drive(0.3, duration=2.0)
    assert readings[0] == pytest.approx(0.6)
    assert readings[1:] == pytest.approx([0.15, 0.15], abs=1e-4)


def test_what_cannot_be_pushed_is_an_obstacle_as_before() -> None:
    """In missions that end at the first contact, in stacks, and without a mass."""
    stacked = world_with(crate(1.0), replace(crate(1.01), pose=Pose((1.01, 0.0, 0.6))))
    fixed = world_with(replace(crate(1.0), mass=None))
    ended = level(experiment(), crate(1.0))
    for world in (stacked, fixed, ended):
        plane = Mission(world)
        assert len(plane.movables.bodies) == 0
        assert plane.drive(0.3, duration=4.0).motion[X] == pytest.approx(0.55, abs=0.006)


def push_in_pybullet(world: World, seconds: float) -> Array:
    with open_alone(PyBullet().open, rover(), world) as opened:
        simulation: Any = opened
        simulation.advance(np.array([0.3, 0.0]), seconds)
        simulation.observe(np.zeros(STATE_SIZE))
        (body,) = simulation._model.movable
        place, _ = simulation._bullet.getBasePositionAndOrientation(body)
    return np.array(place[:2])


@pytest.mark.parametrize(
    ("body", "far", "aside"),
    [(crate(0.6), 0.01, 1.0), (crate(0.6, 0.1), 0.01, 1.0), (crate(0.6, 0.2), 0.15, 5.0),
     (crate(0.6, -0.25), 0.2, 5.0), (barrel(0.6), 0.01, 1.0)],
)  # fmt: skip
@pytest.mark.usefixtures("closed_engines")
def test_both_simulators_push_alike(body: Body, far: float, aside: float) -> None:
    """Distance as a share, and direction [deg], after 3.5 s; loosely if a corner is hit."""
    world, start = world_with(body), np.array(body.pose.position[:2])
    here = Mission(world).drive(0.3, duration=3.5).poses[0, :2] - start
    there = push_in_pybullet(world, 3.5) - start
    assert np.linalg.norm(here) == pytest.approx(np.linalg.norm(there), rel=far)
    angles = [math.degrees(math.atan2(y, x)) for x, y in (here, there)]
    assert angles[0] == pytest.approx(angles[1], abs=aside)
