"""The mission loop on a robot that is a point: everything about its outcome is known exactly."""

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.random import Generator

from evoros.base.arrays import CONTACT, DRIVE_SPEED, SPEED, TO_X, TO_Y, YAW, Array, X, Y
from evoros.base.errors import InputError
from evoros.config.compose import compose
from evoros.controller.blind import Blind
from evoros.controller.protocol import Controller, StartedLayer
from evoros.controller.rover import Rover
from evoros.design.design import Design
from evoros.evolution.experiment import Experiment
from evoros.filter.gaussian_noise import GaussianNoise
from evoros.filter.protocol import Channels, Filter
from evoros.mission import mission as result
from evoros.mission.mission import HEADING, MODE, TIME, TRAJECTORY, Mission
from evoros.mission.rollout import run_mission
from evoros.mission.scenario import Scenario
from evoros.robot.model import Robot
from evoros.sensor.protocol import Mount
from evoros.sensor.sonar import Sonar
from evoros.simulator.protocol import PlacedRobot, Simulation, Simulator
from evoros.world.course import Course
from evoros.world.model import World

PACE = 0.5  # [m/s]


class Head:
    """Straight to the goal: the point turns on the spot. Counts its calls."""

    def __init__(self) -> None:
        self.calls = 0

    def __call__(self, state: Array, leg: Array, command: Array) -> bool:
        self.calls += 1
        command[DRIVE_SPEED] = PACE
        command[1] = math.atan2(leg[TO_Y] - state[Y], leg[TO_X] - state[X])
        return True


class Break(NamedTuple):
    first: float  # [s]
    last: float  # [s]


def shy(parameters: Break, time: float, command: Array) -> bool:
    """Takes the decision during a break, and stands."""
    if parameters.first <= time < parameters.last:
        command[DRIVE_SPEED] = 0.0
        return True
    return False


@dataclass(frozen=True)
class Pilot(Controller):
    """Heads for the goal; stands still, "avoiding", for some time."""

    period_s: float = 0.1
    stands: tuple[float, float] = (math.inf, math.inf)
    localization: Mapping[str, Any] = field(default_factory=dict)
    modes: Sequence[str] = ("avoiding", "navigating")
    heads: list[Head] = field(default_factory=list)

    @contextmanager
    def open(self, robot: Robot, rng: Any) -> Iterator[Sequence[StartedLayer]]:
        self.heads.append(Head())
        yield [StartedLayer(shy, Break(*self.stands)), StartedLayer(self.heads[-1], None)]


@dataclass
class Point:
    """Moves at once, in the direction of the steering; touches where x is in ``wall``."""

    step: float
    wall: tuple[float, float]
    sick_after: int
    sensed: int = 0
    ticks: int = 0
    x: float = 0.0
    y: float = 0.0
    speed: float = 0.0
    yaw: float = 0.0

    def observe(self, state: Array) -> None:
        state[X], state[Y], state[YAW], state[SPEED] = self.x, self.y, self.yaw, self.speed
        state[CONTACT] = self.wall[0] <= self.x <= self.wall[1]
        if self.ticks > self.sick_after:
            state[Y] = math.nan

    def sense(self, readings: Array) -> None:
        self.sensed += 1
        readings[:] = self.sensed

    def advance(self, command: Array, duration: float) -> None:
        assert math.isclose(duration / self.step, round(duration / self.step))
        self.speed, self.yaw = float(command[0]), float(command[1])
        self.x += self.speed * duration * math.cos(self.yaw)
        self.y += self.speed * duration * math.sin(self.yaw)
        self.ticks += 1


@dataclass(frozen=True)
class Plane(Simulator):
    """A simulator without an engine."""

    time_step: float = 0.02
    wall: tuple[float, float] = (math.inf, math.inf)
    sick_after: int = 1_000_000
    opened: list[Point] = field(default_factory=list)
    packages = ()

    @contextmanager
    def open(self, robots: Sequence[PlacedRobot], world: World) -> Iterator[Simulation]:
        self.opened.append(Point(self.time_step, self.wall, self.sick_after))
        yield self.opened[-1]


@pytest.fixture(scope="module")
def experiment() -> Experiment:
    return compose([]).build()


def scenario(
    experiment: Experiment,
    simulator: Any = None,
    controller: Any = None,
    sensors: Mapping[str, Sonar] | None = None,
    **course: Any,
) -> Scenario:
    """Two waypoints ahead: (4, 0) and home, twice; one world on open ground."""
    old = experiment.world["boxes"]
    values: dict[str, Any] = {
        "waypoints": [[4.0, 0.0]],
        "acceptance_m": 1.0,
        "time_limit_s": 100.0,
        "direction": "forward",
        "end_on_collision": True,
    }
    values |= {"home_x_m": 0.0, "home_y_m": 0.0, "home_z_m": 0.0, "home_yaw_rad": 0.0} | course
    ground = tuple(body for body in old.bodies if body.is_ground)
    world = replace(old, name="open", bodies=ground, course=Course(**values))
    member = replace(
        experiment.members[0],
        controller=controller or Pilot(),
        design=replace(experiment.design, sensors=sensors or {"sonar": Sonar()}),
    )
    simulator = simulator or Plane()
    return Scenario((member,), {"open": world}, experiment.failure, simulator)


def mission(*kinds: str, draws: str = "key") -> Mission:
    mounts = tuple(Mount(kind, "base_link", 0.2, 0.0, 0.166, 0.0, 12.5) for kind in kinds)
    return Mission(0, 1, Design(mounts), "open", 0, "evaluation", draws)


# How missions end, and what they measure.


def test_a_mission_that_is_completed(experiment: Experiment) -> None:
    """3 m to the first circle, then back and forth between the circles: 2 m each."""
    (outcome,), rows = run_mission(scenario(experiment), mission("sonar"))
    assert outcome.ended == "completed"
    assert outcome.completed
    assert outcome.progress == 1.0
    assert outcome.visited == 4  # (4, 0), home, (4, 0), home
    assert outcome.time_s == pytest.approx((3 + 2 + 2 + 2) / PACE, abs=0.5)
    assert outcome.distance_m == pytest.approx(PACE * outcome.time_s)
    assert outcome.mean_speed_mps == pytest.approx(PACE)
    assert outcome.max_speed_mps == PACE
    assert outcome.least_waypoint_distances_m == pytest.approx((1.0, 0.0), abs=0.051)
    assert outcome.collisions == 0
    assert math.isnan(outcome.first_collision_s)
    assert outcome.avoiding == 0.0
    assert math.isnan(outcome.least_clearance_m)
    assert rows[-1, TIME] == outcome.time_s
    assert np.diff(rows[:, TIME]) == pytest.approx(0.1)


def test_a_mission_that_runs_to_its_limit(experiment: Experiment) -> None:
    (outcome,), rows = run_mission(scenario(experiment, time_limit_s=5.0), mission("sonar"))
    assert outcome.ended == "time_limit"
    assert outcome.time_s == pytest.approx(5.0)
    assert rows[-1, 1] == pytest.approx(2.5)
    assert outcome.visited == 0
    assert outcome.progress == pytest.approx((1 / max(4 - 2.5 - 1, 1)) / 4)


@pytest.mark.parametrize(("limit", "left"), [(0.2, 2.9), (2.0, 2.0)])
def test_progress_is_shared_by_the_way_that_is_left(
    experiment: Experiment, limit: float, left: float
) -> None:
    (outcome,), _ = run_mission(scenario(experiment, time_limit_s=limit), mission("sonar"))
    assert outcome.progress == pytest.approx(1 / left / 4)


def test_a_collision_ends_the_mission(experiment: Experiment) -> None:
    (outcome,), _ = run_mission(scenario(experiment, Plane(wall=(1.99, 9.0))), mission("sonar"))
    assert outcome.ended == "collision"
    assert outcome.time_s == outcome.first_collision_s == pytest.approx(4.0)
    assert outcome.collisions == 1
    assert not outcome.completed


def test_a_collision_that_lasts_counts_once_and_need_not_end_it(experiment: Experiment) -> None:
    """The wall is passed on each of the four legs."""
    flown = scenario(experiment, Plane(wall=(1.99, 2.51)), end_on_collision=False)
    (outcome,), rows = run_mission(flown, mission("sonar"))
    assert outcome.ended == "completed"
    assert outcome.collisions == 4
    assert outcome.first_collision_s == pytest.approx(4.0)
    assert rows[:, 8].sum() > 4


def test_the_last_waypoint_counts_even_if_it_is_touched(experiment: Experiment) -> None:
    (outcome,), _ = run_mission(
        scenario(experiment, Plane(wall=(-1.0, 9.0)), end_on_collision=True, acceptance_m=9.0),
        mission("sonar"),
    )
    assert outcome.visited == 1
    assert outcome.ended == "collision"


def test_a_collision_in_the_tick_of_the_last_waypoint_leaves_the_mission_completed(
    experiment: Experiment,
) -> None:
    """A waypoint counts in each of the first four ticks; the point moves before the fourth."""
    pilot = Pilot(stands=(0.0, 0.2))
    flown = scenario(experiment, Plane(wall=(0.04, 9.0)), pilot, acceptance_m=9.0)
    (outcome,), _ = run_mission(flown, mission("sonar"))
    assert outcome.visited == 4
    assert outcome.collisions == 1
    assert outcome.first_collision_s == outcome.time_s == pytest.approx(0.3)
    assert outcome.completed


def test_the_share_of_avoiding(experiment: Experiment) -> None:
    flown = scenario(experiment, controller=Pilot(stands=(1.0, 3.0)), time_limit_s=8.0)
    (outcome,), rows = run_mission(flown, mission("sonar"))
    assert outcome.avoiding == pytest.approx(2.0 / 8.0, abs=1e-9)
    assert outcome.distance_m == pytest.approx(PACE * 6.0)
    assert outcome.mean_speed_mps == pytest.approx(PACE * 6.0 / 8.0)
    assert set(rows[:, MODE]) == {1.0, 2.0}


def test_a_state_that_is_not_finite_is_an_outcome(experiment: Experiment) -> None:
    (outcome,), rows = run_mission(scenario(experiment, Plane(sick_after=30)), mission("sonar"))
    assert outcome.ended == result.SIMULATION_FAILURE
    assert "not finite after 3.1 s" in outcome.reason
    assert outcome.progress == 0.0
    assert math.isnan(outcome.least_clearance_m)
    assert rows.size == 0


# Clocks.


@settings(deadline=None, max_examples=25)
@given(
    sense=st.sampled_from([0.02, 0.1, 0.2, 0.06, 0.5]),
    decide=st.sampled_from([0.02, 0.1, 0.2, 0.06, 0.5]),
    decisions=st.integers(3, 30),
)
def test_each_part_runs_at_its_own_period(
    experiment: Experiment, sense: float, decide: float, decisions: int
) -> None:
    limit = decisions * decide
    simulator, pilot = Plane(), Pilot(period_s=decide)
    flown = scenario(
        experiment, simulator, pilot, {"sonar": Sonar(period_s=sense)}, time_limit_s=limit
    )
    (outcome,), _ = run_mission(flown, mission("sonar"))
    end = outcome.time_s
    assert end == pytest.approx(limit)
    assert simulator.opened[-1].sensed == math.ceil(round(end / sense, 6))
    assert pilot.heads[-1].calls == math.ceil(round(end / decide, 6))


def test_sensor_types_publish_at_their_own_periods(experiment: Experiment) -> None:
    """A point's readings count its calls of sense, one every 0.1 s."""
    sensors = {"fast": Sonar(period_s=0.1), "slow": Sonar(period_s=0.3)}
    _, rows = run_mission(
        scenario(experiment, sensors=sensors, time_limit_s=3.0), mission("fast", "slow", "fast")
    )
    ticks = np.arange(30)
    assert (rows[:30, 9:11] == (ticks + 1)[:, None]).all()
    assert (rows[:30, 11] == 3 * (ticks // 3) + 1).all()


@pytest.mark.parametrize(
    ("sensors", "controller", "key"),
    [
        ({"sonar": Sonar(period_s=0.03)}, Pilot(), "design.sensors.sonar.period_s"),
        ({"sonar": Sonar()}, Pilot(period_s=0.01), "controller.period_s"),
    ],
)
def test_periods_are_multiples_of_the_step(
    experiment: Experiment, sensors: Any, controller: Any, key: str
) -> None:
    with pytest.raises(InputError, match=key):
        scenario(experiment, controller=controller, sensors=sensors)


@pytest.mark.parametrize("limit", [1.03, 0.05, 1.001])
def test_a_time_limit_is_a_multiple_of_the_control_period(
    experiment: Experiment, limit: float
) -> None:
    with pytest.raises(InputError, match=r"world.open.course.time_limit_s: .* multiple"):
        scenario(experiment, time_limit_s=limit)


# Draws.


@dataclass(frozen=True)
class Spy(Filter):
    """A filter that notes what it could have drawn, and draws ``extra`` numbers first."""

    name = "Spy"
    noted: list[float] = field(default_factory=list)
    extra: int = 0

    def start(self, channels: Channels, onset: Array, rng: Generator) -> None:
        rng.random(self.extra)
        self.noted.append(rng.random())

    @staticmethod
    def rule(rng: Generator) -> None:
        """Only draws."""
        rng.random()


def test_a_new_filter_does_not_shift_the_draws_of_others(experiment: Experiment) -> None:
    seen, tracks = [], []
    for before in ({}, {"greedy": Spy(extra=5)}):
        spy, noise = Spy(), GaussianNoise(0.01)
        sensor = Sonar(filters={**before, "noise": noise, "spy": spy}, range_max_m=1e6)
        pilot = Pilot(localization=dict(before))
        _, rows = run_mission(
            scenario(experiment, controller=pilot, sensors={"sonar": sensor}, time_limit_s=2.0),
            mission("sonar", "sonar"),
        )
        seen.append(spy.noted)
        tracks.append(rows)
    assert seen[0] == seen[1]
    assert np.array_equal(tracks[0], tracks[1])


def test_equal_draws_repeat_a_mission_and_others_do_not(experiment: Experiment) -> None:
    sensor = Sonar(filters={"noise": GaussianNoise(0.01)}, range_max_m=1e6)
    flown = scenario(experiment, sensors={"sonar": sensor}, time_limit_s=2.0)
    (first, a), (again, b), (_, other) = (
        run_mission(flown, mission("sonar", draws=key)) for key in ("a", "a", "b")
    )
    assert repr(first) == repr(again)
    assert np.array_equal(a, b)
    assert not np.array_equal(a, other)
    assert len(a[0]) == len(TRAJECTORY) + 1


@pytest.mark.slow
def test_late_positions_make_ardupilots_law_weave(experiment: Experiment) -> None:
    """By 30 deg to either side, as the paper says (a 60 deg arc), every 9.7 s; exact ones do not.

    The rover starts obliquely, for nothing else disturbs a simulation.
    """
    swings = []
    for localization in ("autopilot_gps", "exact"):
        name = f"controller/localization={localization}"
        controller = compose(["controller=rover_l1", name]).build().controller
        assert isinstance(controller, Rover)
        course: dict[str, Any] = {
            "waypoints": [[30.0, 0.0]],
            "time_limit_s": 60.0,
            "home_yaw_rad": 0.5,
        }
        blind = replace(controller, avoidance=Blind())
        _, rows = run_mission(
            scenario(experiment, experiment.simulator, blind, **course), mission()
        )
        settled = rows[rows[:, TIME] > 15.0]
        swings.append(np.degrees(np.ptp(settled[:, HEADING])))
        if localization == "autopilot_gps":
            rising = np.flatnonzero((settled[1:, HEADING] > 0) & (settled[:-1, HEADING] <= 0))
            period = float(np.diff(settled[rising, TIME]).mean())
    assert swings[0] == pytest.approx(60.0, abs=12.0)
    assert period == pytest.approx(9.7, abs=0.7)
    assert swings[1] < 2.0
