"""Walkers in every engine: where the rule puts them, what sensors see of them, whom they touch."""

import math
from typing import Any

import numpy as np
import pytest
from team_cases import FRONTS, NAMES, STEP, create, equip, load
from walker_cases import crowd_of, open_world, report, walkers, walking

from evoros.base.arrays import CONTACT, X, Y
from evoros.sensor.bumper import Bumper
from evoros.simulator.protocol import PlacedRobot
from evoros.walkers.layout import REPORT_TOUCHED

pytestmark = pytest.mark.usefixtures("closed_engines")

AHEAD = (0.3, 0.0, 0.3, 0.0)
"""A ray from 0.3 m ahead of the rover's origin, at a height of 0.3 m."""
HOME = (0.0, 0.0, 0.0, 0.0)


@pytest.fixture(params=NAMES)
def simulator(request: pytest.FixtureRequest) -> Any:
    return create(str(request.param))


def test_a_ray_measures_the_distance_to_a_walker(simulator: Any) -> None:
    robot, radius, step = equip("erle_rover", AHEAD), 0.3, STEP
    crossing = walkers(route=[(3.0, -1.0), (3.0, 9.0)], radius_m=radius)
    signals, seen = np.zeros(robot.signal_count), 0
    placed = [PlacedRobot(robot, HOME)]
    with walking(simulator, placed, open_world(), people=crossing) as simulation:
        for tick in range(41):
            (state,), ((x, y, _),) = report(simulation, 1, 1)
            assert (x, y) == pytest.approx((3.0, -1.0 + step * tick), abs=1e-9)
            simulation.sense(signals)
            aside = y - state[Y]
            if abs(aside) < radius - 0.05:
                near = 3.0 - math.sqrt(radius * radius - aside * aside) - AHEAD[0] - state[X]
                assert signals[0] == pytest.approx(near, abs=0.005)
                seen += 1
            elif abs(aside) > radius + 0.05:
                assert signals[0] == 4.5
            simulation.advance(np.zeros(2), step)
    assert seen > 5


def test_a_walker_touches_a_standing_robot_and_the_report_names_it(simulator: Any) -> None:
    """The first one walks beside, the second one from ahead into the robot."""
    beside = walkers(route=[(2.0, 3.0), (-6.0, 3.0)])
    into = walkers(route=[(2.0, 0.0), (-6.0, 0.0)])
    placed = [PlacedRobot(load("erle_rover"), HOME)]
    gap = 2.0 - FRONTS["erle_rover"] - into.radius_m
    with walking(simulator, placed, open_world(), a=beside, b=into) as simulation:
        time = 0.0
        while True:
            (state,), reports = report(simulation, 1, 2)
            if state[CONTACT] > 0.0:
                break
            assert reports[:, REPORT_TOUCHED].tolist() == [0.0, 0.0]
            simulation.advance(np.zeros(2), STEP)
            time += STEP
        assert time == pytest.approx(gap / 1.0, abs=2 * STEP)
        assert reports[:, REPORT_TOUCHED].tolist() == [0.0, 1.0]


def test_a_robot_drives_into_a_walker_that_waits_for_it(simulator: Any) -> None:
    standing = walkers(
        route=[(1.5, 0.0), (-6.0, 0.0)], stops_for_robots=True, stop_distance_m=9.0,
        patience_s=99.0, pace_mps=0.01,
    )  # fmt: skip
    placed = [PlacedRobot(load("erle_rover"), HOME)]
    with walking(simulator, placed, open_world(), people=standing) as simulation:
        for _ in range(200):
            (state,), ((x, _, touched),) = report(simulation, 1, 1)
            if state[CONTACT] > 0.0:
                break
            simulation.advance(np.array([0.3, 0.0]), STEP)
        assert x == pytest.approx(1.5, abs=0.05)
        assert touched == 1.0
        reach = FRONTS["erle_rover"] + standing.radius_m
        assert x - state[X] == pytest.approx(reach, abs=0.03)
        for _ in range(20):
            simulation.advance(np.array([0.3, 0.0]), STEP)
        (state,), ((x, _, _),) = report(simulation, 1, 1)
        assert x - state[X] > reach - 0.03  # it does not drive through
        for _ in range(40):
            simulation.advance(np.array([-0.3, 0.0]), STEP)
        (state,), ((later, _, _),) = report(simulation, 1, 1)
        assert later - state[X] > reach + 0.1  # and can drive off


def test_a_bumper_feels_a_walker(simulator: Any) -> None:
    bumper = Bumper(depth_m=0.2, width_m=0.3)
    front = (FRONTS["erle_rover"], 0.0, 0.2, 0.0)
    robot = equip("erle_rover", bumper=(bumper, front))
    into = walkers(route=[(1.0, 0.0), (-6.0, 0.0)])
    signals = np.zeros(robot.signal_count)
    with walking(simulator, [PlacedRobot(robot, HOME)], open_world(), people=into) as simulation:
        for _ in range(40):
            simulation.advance(np.zeros(2), STEP)
            simulation.sense(signals)
            if signals[0] > 0.0:
                break
        (state,), _ = report(simulation, 1, 1)
    assert state[CONTACT] > 0.0
    assert signals[0] > 0.0


def test_the_second_robot_is_named_by_its_bit(simulator: Any) -> None:
    robot = load("erle_rover")
    placed = [PlacedRobot(robot, HOME), PlacedRobot(robot, (0.0, 4.0, 0.0, 0.0))]
    into = walkers(route=[(1.2, 4.0), (-6.0, 4.0)])
    with walking(simulator, placed, open_world(), people=into) as simulation:
        for _ in range(30):
            simulation.advance(np.zeros(4), STEP)
        states, ((_, _, touched),) = report(simulation, 2, 1)
    assert touched == 2.0
    assert states[:, CONTACT].tolist() == [0.0, 1.0]


def test_absent_walkers_have_no_place(simulator: Any) -> None:
    robot = equip("erle_rover", AHEAD)
    several = walkers(number=[0, 3], route=[(3.0, 0.0), (3.0, 9.0)])
    counts, signals = set(), np.zeros(robot.signal_count)
    for i in range(6):
        placed = [PlacedRobot(robot, HOME)]
        crowd = crowd_of({"people": several}, robots=placed, draws=f"{i}")
        with simulator.open(placed, open_world().with_crowd(crowd)) as simulation:
            simulation.sense(signals)
            _, reports = report(simulation, 1, 3)
        count = int(np.isfinite(reports[:, 0]).sum())
        assert np.isnan(reports[count:, :2]).all()
        assert (signals[0] < 4.4) == (count > 0)
        counts.add(count)
    assert len(counts) > 1


def test_every_engine_says_that_it_moves_walkers(simulator: Any) -> None:
    assert simulator.has_walkers
