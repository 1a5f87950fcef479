"""Several robots in a world: they see and touch one another, in every simulator alike."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from planar_cases import experiment, world_of
from pybullet_cases import box
from team_cases import (
    FRONTS,
    NAMES,
    STEP,
    WHEELS,
    Place,
    create,
    drive,
    equip,
    facing,
    first_contacts,
    load,
    observe,
    read,
)

from evoros.base.arrays import CONTACT, X
from evoros.base.errors import SimulationError
from evoros.compilation.rules import SIMULATION_RULES, compile_rule
from evoros.geometry.shapes import Body
from evoros.sensor.bumper import Bumper
from evoros.sensor.imu import Imu
from evoros.sensor.odometry import Odometry
from evoros.sensor.protocol import Sensor
from evoros.simulator.engines.teams import MAX_ROBOTS
from evoros.simulator.planar import Planar
from evoros.simulator.protocol import PlacedRobot, RuleSimulation, SimulationRules
from evoros.simulator.pybullet import PyBullet
from evoros.world.model import World

pytestmark = pytest.mark.usefixtures("closed_engines")

DEPTHS = {"planar": 0.0, "mujoco": 0.005, "pybullet": 0.012, "gazebo": 0.005}
"""How far [m] robots that drive into each other at 0.2 m/s overlap at most."""


@pytest.fixture(params=NAMES)
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def simulator(name: str) -> Any:
    return create(name)


def ground() -> World:
    return world_of()


@pytest.mark.parametrize(
    ("pair", "yaw"), [(("erle_rover", "mule"), 0.0), (("courier", "erle_rover"), 2.3)]
)
def test_robots_read_their_distance(simulator: Any, pair: tuple[str, str], yaw: float) -> None:
    """Ahead each meets the front of the other; to the side its wheel, if any; back, its front."""
    first, second = (
        equip(kind, (0.4, 0, 0.1, 0), (0, 0, 0.1, 90), (0.4, 0.0, 0.1, 180)) for kind in pair
    )
    robots = facing(first, second, 2.0, yaw)
    with simulator.open(robots, ground()) as simulation:
        seen = read(simulation, robots)
    expected = [
        distance
        for one, other in (pair, pair[::-1])
        for distance in (1.6 - FRONTS[other], WHEELS[one], 0.4 - FRONTS[one])
    ]
    assert seen == pytest.approx(expected, abs=1e-6)


def test_readings_follow_robots_that_move(simulator: Any, name: str) -> None:
    robot = equip("erle_rover", (0.3, 0, 0.1, 0))
    robots = facing(robot, robot, 3.0)
    states, ranges = drive(simulator, robots, ground(), [(0.3, 0), (0.1, 0)], 60)
    gap = states[:, 1, X] - states[:, 0, X] - 0.3 - FRONTS["erle_rover"]
    assert gap[0] - gap[-1] == pytest.approx(0.4 * 59 * STEP, rel=0.02)
    tolerance = 1e-6 if name == "planar" else 2e-3  # rigid bodies pitch a little
    assert ranges == pytest.approx(np.stack([gap, gap], axis=1), abs=tolerance)


def test_bumpers_feel_robots(simulator: Any) -> None:
    """That in front feels the other robot, those at the rear nothing; whichever drives."""
    bumpers: dict[str, tuple[Sensor, Place]] = {
        "front": (Bumper(), (0.25, 0, 0.1, 0)),
        "rear": (Bumper(), (-0.2, 0, 0.1, 180)),
    }
    robot = equip("erle_rover", **bumpers)
    _, touches = drive(simulator, facing(robot, robot, 0.6), ground(), [(0.2, 0), (0, 0)], 20)
    assert (touches[5] == 0.0).all()
    front, rear = (part.start for part in robot.signal_layout)
    for first in (0, robot.signal_count):
        assert touches[-1, first + front] > 0.0
        assert touches[-1, first + rear] == 0.0


@pytest.mark.parametrize("speeds", [(0.2, 0.2), (0.2, 0.0), (0.0, 0.2)])
def test_robots_that_meet_both_report_contact(
    simulator: Any, name: str, speeds: tuple[float, float]
) -> None:
    """In the period in which their outlines meet, whichever drives into the other."""
    if name == "planar":
        simulator = replace(simulator, steering_lag_s=0.0, drive_lag_s=0.0)
    pair = ("mule", "erle_rover")
    robots = facing(load(pair[0]), load(pair[1]), 0.7731)
    states, _ = drive(simulator, robots, ground(), [(speeds[0], 0), (speeds[1], 0)], 60)
    first, second = first_contacts(states)
    assert first == second > 0
    reach = FRONTS[pair[0]] + FRONTS[pair[1]]
    gaps = states[:, 1, X] - states[:, 0, X] - reach
    if name == "planar":  # the step that would close the gap is not made
        step, closing = simulator.time_step, [speed * simulator.time_step for speed in speeds]
        left, steps = 0.7731 - reach, 0
        while left > closing[0] and left > sum(closing):
            left, steps = left - sum(closing), steps + 1
        assert first == math.floor(steps * step / STEP + 1e-9)
        assert (gaps > 0.0).all()
        assert gaps[-1] <= max(closing)
    else:
        late = sum(speeds) * simulator.time_step  # an engine looks for contacts before it moves
        assert gaps[first - 1] > -late - 1e-3
        assert gaps[first] < 1e-3
    assert gaps.min() >= -DEPTHS[name]


def test_robots_that_are_apart_move_as_each_alone(simulator: Any, name: str) -> None:
    """They read the same, between obstacles, which they see; nor does their order matter."""
    world = experiment().world["maze"]
    rays = (0.3, 0, 0.1, 0), (0.3, 0, 0.1, 40)
    others: dict[str, tuple[Sensor, Place]] = {
        "imu": (Imu(), (0.1, 0, 0.2, 0)),
        "odometry": (Odometry(), (0, 0, 0.2, 0)),
    }
    rover, courier = equip("erle_rover", *rays, **others), equip("courier", *rays)
    x, y, z, yaw = world.course.home
    robots = [PlacedRobot(rover, (x, y, z, yaw)), PlacedRobot(courier, (x + 9.0, y, z, 1.0))]
    commands = [(0.3, 0.2), (0.25, -0.1)]
    states, signals = drive(simulator, robots, world, commands, 60)
    swapped, sensed = drive(simulator, robots[::-1], world, commands[::-1], 60)
    first = rover.signal_count
    assert first > 2
    assert signals[:, :2].min() < 4.5
    tolerance = 1e-5 if name == "mujoco" else 0.0  # its solver stops for all robots at once
    assert np.abs(states - swapped[:, ::-1]).max() <= tolerance
    assert np.abs(signals - np.roll(sensed, first, axis=1)).max() <= tolerance
    for i in range(2):
        alone, single = drive(simulator, robots[i : i + 1], world, commands[i : i + 1], 60)
        assert np.abs(states[:, i : i + 1] - alone).max() <= tolerance
        part = signals[:, :first] if i == 0 else signals[:, first:]
        assert np.abs(part - single).max() <= tolerance


def test_skid_steer_lends_its_friction_to_the_others() -> None:
    """In PyBullet, which has one law of friction a world."""
    robots = [
        PlacedRobot(load("mule"), (0, 0, 0, 0)),
        PlacedRobot(load("erle_rover"), (9, 0, 0, 0)),
    ]
    commands = [(0.3, 0.2), (0.3, 0.2)]
    states, _ = drive(PyBullet(), robots, ground(), commands, 100)
    for i, tolerance in enumerate((0.0, 2e-3)):
        alone, _ = drive(PyBullet(), robots[i : i + 1], ground(), commands[i : i + 1], 100)
        assert np.abs(states[:, i, :2] - alone[:, 0, :2]).max() <= tolerance


@pytest.mark.slow
def test_compiled_rules_give_the_bits_of_the_interpreted() -> None:
    """Those with pushing, which contain the others; a whole mission of two compares those."""
    robots = facing(equip("erle_rover", (0.3, 0.1, 0.1, 0)), equip("mule", (0.3, 0, 0.1, 20)), 1.2)
    commands, results = np.array([0.3, 0.05, 0.25, 0.1]), []
    crate = box("crate", 0.6, size=(0.2, 0.2, 0.2), mass=1.0)
    world = between(crate, world=experiment().world["maze"])
    for compiled in (True, False):
        with Planar().open(robots, world) as simulation:
            rules: Any = simulation.rules
            if compiled:
                rules = SimulationRules(*map(compile_rule, rules, SIMULATION_RULES))
            simulation = RuleSimulation(rules, simulation.parameters, simulation.memory)
            rows = []
            for _ in range(30):
                simulation.advance(commands, 0.1)
                rows += [observe(simulation, 2).ravel(), read(simulation, robots)]
        results.append(np.concatenate(rows).tobytes())
    assert results[0] == results[1]


def test_what_cannot_be_simulated_is_refused_in_one_line(simulator: Any) -> None:
    assert simulator.max_robots == MAX_ROBOTS
    crowd = [PlacedRobot(load("erle_rover"), (2.0 * i, 0, 0, 0)) for i in range(MAX_ROBOTS + 1)]
    with (
        pytest.raises(SimulationError, match=f"a world can have 1 to {MAX_ROBOTS} robots, not 17"),
        simulator.open(crowd, ground()),
    ):
        pass
    with pytest.raises(SimulationError, match="not 0"), simulator.open([], ground()):
        pass
    with simulator.open(crowd[:-1], ground()) as simulation:
        simulation.advance(np.tile([0.2, 0.0], MAX_ROBOTS), STEP)
        assert not observe(simulation, MAX_ROBOTS)[:, CONTACT].any()


def between(*crates: Body, world: World | None = None) -> World:
    """A world, or level ground, with crates that can be pushed and missions that go on."""
    world = world or ground()
    course = replace(world.course, end_on_collision=False)
    return replace(world, bodies=(*world.bodies, *crates), course=course)


def test_a_crate_that_stands_ends_missions_at_the_first_contact() -> None:
    robots = facing(load("erle_rover"), load("erle_rover"), 2.0)
    world = between(box("crate", 1.0, mass=1.0))
    world = replace(world, course=replace(world.course, end_on_collision=True))
    states, _ = drive(create("planar"), robots, world, [(0.3, 0.0), (0.0, 0.0)], 20)
    assert first_contacts(states) == [16, -1]


@pytest.mark.slow
def test_a_robot_pushes_a_crate_until_it_meets_another_robot() -> None:
    """The other one sees it come, feels it in front, and neither yields; nothing overlaps."""
    simulator = create("planar")
    front: dict[str, tuple[Sensor, Place]] = {"front": (Bumper(), (0.25, 0, 0.1, 0))}
    robot = equip("erle_rover", (0.15, 0, 0.1, 0), **front)
    robots, reach = facing(robot, robot, 2.0), FRONTS["erle_rover"]
    world = between(box("crate", 0.75, size=(0.4, 0.4, 0.4), mass=1.0))
    commands = [(0.2, 0.0), (0.0, 0.0)]
    states, signals = drive(simulator, robots, world, commands, 140)
    crate = states[:, 0, X] + reach + 0.2  # its centre, as long as it is pushed
    first, second = first_contacts(states)
    assert first == pytest.approx((0.55 - reach) / (0.2 * STEP), abs=2)
    pushed = slice(first + 1, second)
    ranges = signals[:, robot.signal_count]
    assert ranges[pushed] == pytest.approx(1.85 - crate[pushed] - 0.2, abs=2e-3)
    assert ranges[0] == pytest.approx(1.85 - 0.95, abs=2e-3)
    gap = 2.0 - reach - (states[-1, 0, X] + reach + 0.4)
    assert 0.0 <= gap + 1e-4 < 0.2 * simulator.time_step + 2e-4
    assert second == pytest.approx((2.0 - 2 * reach - 0.4) / (0.2 * STEP), abs=2)
    assert (states[:, 1, X] == 2.0).all()
    (bumper,) = (part.start for part in robot.signal_layout if part.start != 0)
    felt = signals[:, robot.signal_count + bumper]
    assert felt[second - 1] == 0.0 < felt[-1]
    again, _ = drive(simulator, robots, world, commands, 140)
    assert again.tobytes() == states.tobytes()


@pytest.mark.slow
def test_robots_that_push_apart_do_so_as_each_alone() -> None:
    kinds = [("erle_rover", 0.0), ("mule", 9.0)]
    robots = [PlacedRobot(equip(name, (0.2, 0, 0.3, 0)), (x, 0, 0, 0.2)) for name, x in kinds]
    crates = [box(f"crate{x}", x + 0.6, 0.1, (0.3, 0.3, 0.3), mass=1.0) for _, x in kinds]
    commands = [(0.2, 0.1), (0.3, -0.1)]
    world, simulator = between(*crates), create("planar")
    states, signals = drive(simulator, robots, world, commands, 60)
    for i in range(2):
        alone, read = drive(simulator, robots[i : i + 1], world, commands[i : i + 1], 60)
        assert first_contacts(alone)[0] > 0
        assert states[:, i].tobytes() == alone[:, 0].tobytes()
        assert signals[:, i].tobytes() == read[:, 0].tobytes()


def test_a_failure_names_the_robot() -> None:
    """It is the one of three whose state is not a number."""
    robots = [PlacedRobot(load("erle_rover"), (2.0 * i, 0, 0, 0)) for i in range(3)]
    simulator = create("mujoco")
    with simulator.open(robots, ground()) as simulation:
        root, _ = simulation._model.robots[1].root
        simulation._model.data.qpos[root] = math.nan
        simulation.advance(np.zeros(6), STEP)
        with pytest.raises(SimulationError, match=r"robot 1 \(erle_rover\): MuJoCo: .* DOF"):
            observe(simulation, 3)
