"""Warnings before a run: sensors that see the ground, unfit courses, steps that are too coarse."""

import math
import re
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from helpers import alone
from proposal_sites import is_of

from evoros.base.arrays import COMMAND_SIZE, STATE_SIZE, STEERING, YAW, Array, X, Y
from evoros.base.errors import InputError, SimulationError, WorkerLost
from evoros.config.compose import compose
from evoros.evolution.experiment import Experiment
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.preflight import advice
from evoros.preflight.drive import check_drive, report_drive
from evoros.preflight.preflight import preflight
from evoros.preflight.routes import check_home, check_routes
from evoros.preflight.sight import check_gaps, check_housings, check_self_sight, check_sight
from evoros.robot.model import Robot
from evoros.simulator.mujoco import Mujoco
from evoros.simulator.planar import Planar
from evoros.simulator.protocol import PlacedRobot, Simulator, open_alone
from evoros.simulator.pybullet import PyBullet
from evoros.world.floors import GROUND
from evoros.world.model import World


@cache
def build(*overrides: str, simulator: str = "planar") -> Experiment:
    return compose([f"simulator={simulator}", "executor=serial", *overrides]).build()


BUNDLED = [
    *(["experiment=" + name] for name in ("case_study", "dense", "quickstart")),
    ["experiment=as_run", "robot.drive.turning_x_m=null"],
    ["world=generated"],
    ["robot=two_wheeler"],
    ["design=around"],
    ["robot=two_wheeler", "design=around", "robot.mount=null"],
]


@pytest.mark.parametrize("overrides", BUNDLED, ids=" ".join)
def test_what_is_bundled_gives_no_warning(overrides: list[str]) -> None:
    experiment = build(*overrides)
    checks = check_home, check_routes, check_sight, check_self_sight
    assert [line for check in checks for line in check(alone(experiment))] == []
    assert check_drive(replace(experiment, simulator=PyBullet())) == []


@pytest.mark.slow
def test_cases_of_failure_that_no_trial_meets_are_told(caplog: pytest.LogCaptureFixture) -> None:
    times = "failure.times_s=[0.0]"
    for trials, told in ((1, True), (63, True), (64, False)):  # six sensors have 64 sets
        caplog.clear()
        preflight(build("failure=exhaustive", times, f"trials={trials}"))
        assert is_of(caplog.text, "evoros/preflight/preflight.py trials={cases}") == told
        assert not told or "set trials=64 to test all" in caplog.text


def test_an_engine_whose_wheels_do_not_slide_as_stated_is_told() -> None:
    experiment = build("experiment=as_run")
    (line,) = check_drive(replace(experiment, simulator=PyBullet()))
    assert line.startswith("simulator: erle_rover turns about x=-0.15 m, where its wheels roll")
    assert "turning_x_m=0.12" in line
    assert is_of(line, "evoros/preflight/drive.py robot.drive.turning_x_m={drive.rear_axle_x_m}")
    for proposed, simulator in (("robot.drive.turning_x_m=null", PyBullet()), ("", Planar())):
        typed = build("experiment=as_run", *filter(None, [proposed]))
        assert check_drive(replace(typed, simulator=simulator)) == []
    sliding = replace(experiment, simulator=Stub(turning_x_m=0.12))
    assert check_drive(sliding) == []


def test_a_mount_that_is_chosen_is_told(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level("INFO", "evoros")
    preflight(
        build("robot=two_wheeler", "design=around", "robot.mount.link=null", "robot.mount.z_m=null")
    )
    assert "two_wheeler: the sensors get the default mount: robot.mount.link=base_link" in (
        caplog.text
    )
    assert "robot.mount.z_m=" in caplog.text
    assert "robot.mount.pitch_deg=" not in caplog.text


# Sensors ------------------------------------------------------------------------------------


def cart(*overrides: str) -> Experiment:
    return build("robot=two_wheeler", "design=around", *overrides)


@pytest.mark.slow
def test_ground_within_the_range_of_the_avoidance_is_told_with_the_pitch_that_helps() -> None:
    (line,) = check_sight(alone(cart("robot.mount.pitch_deg=0")))
    # The lowest rays, 15 deg below the horizon, leave from a height of 0.166 m.
    assert "in 8 of 8 designs" in line
    assert f"sees the ground {0.166 / math.sin(math.radians(15)):.3g} m away" in line
    assert "within controller.avoidance.range_m (2 m)" in line
    advice = re.search(r"raise the pitch to at least (\d+) deg", line)
    assert advice is not None
    pitch = int(advice[1])
    assert list(check_sight(alone(cart(f"robot.mount.pitch_deg={pitch}")))) == []
    assert len(list(check_sight(alone(cart(f"robot.mount.pitch_deg={pitch - 2}"))))) == 1
    near = "controller.avoidance.range_m=0.6"
    assert list(check_sight(alone(cart("robot.mount.pitch_deg=0", near)))) == []


def test_the_range_that_evolves_counts() -> None:
    gene = (
        "+design.genes.avoid={_target_: evoros.design.genes.Gene, "
        "key: controller.avoidance.range_m, low: %s, high: %s}"
    )
    level = "robot.mount.pitch_deg=0"
    assert list(check_sight(alone(cart(level, gene % (0.2, 0.6))))) == []
    (line,) = check_sight(alone(cart(level, gene % (0.2, 4))))
    assert "in 8 of 8" not in line


def test_a_controller_without_avoidance_sees_no_ground() -> None:
    blind = "controller/avoidance=blind"
    assert list(check_sight(alone(cart("robot.mount.pitch_deg=-30", blind)))) == []


@pytest.mark.slow
def test_a_pole_between_the_rays_is_told_with_the_number_that_sees_it() -> None:
    """The bundled sonar's rays are 7.5 deg apart: 13 cm at 1 m, the range of the avoidance 2 m."""

    def warn(*overrides: str, width: float = 0.04) -> list[str]:
        subject = alone(build(*overrides))
        world = next(iter(subject.scenario.world.values()))
        pole = Body("pole", Pose((3.0, 0.0, 0.5)), (Shape("cylinder", (width / 2, 1.0)),))
        wall = Body("wall", Pose((5.0, 0.0, 0.5)), (Shape("box", (0.02, 8.0, 1.0)),))
        placed = replace(world, bodies=(GROUND, pole, wall))
        return list(
            check_gaps(subject._replace(scenario=replace(subject.scenario, world={"w": placed})))
        )

    (warning,) = warn()
    assert "'pole', which is 0.04 m wide" in warning
    key, rays = re.search(r"set (\S+)=(\d+)", warning).groups()  # type: ignore[union-attr]
    gap = math.radians(30.0) / (int(rays) - 1)
    assert 2.0 * gap <= 0.04 < 2.0 * math.radians(30.0) / (int(rays) - 2)
    assert warn(f"{key}={rays}") == []
    lower = re.search(r"lower (\S+) to (\S+)$", warning).groups()  # type: ignore[union-attr]
    assert warn("=".join(lower)) == []
    assert warn(width=0.3) == []
    assert "0.13 m apart and can miss" in warn("controller/avoidance=blind")[0]


def test_a_sensor_that_would_see_the_robot_is_told() -> None:
    region = "{_target_: evoros.design.region.Region, x_m: -0.19, y_m: 0, yaw_deg: 0}"
    (line,) = check_self_sight(alone(build(f"+design.regions.tail={region}", "design.number=9")))
    # The cage begins at x = -0.17 m.
    assert re.search(
        r"blocks \d+ % of .* at some steering angle, the sensor sees base_link 0.02 m",
        line,
    )


def test_the_mask_that_is_proposed_for_an_own_lidar_works_when_typed() -> None:
    """The cage of the rover stands behind the lidar in every design."""
    fixed = "{_target_: evoros.design.space.FixedSensor, sensor: scan, link: base_link, x_m: 0, "
    lidar = (
        "+sensor@design.sensors.scan=lidar",
        "+design.fixed.scan=" + fixed + "z_m: 0.166}",
        "robot.mount.pitch_deg=12.5",
    )
    *_, line = check_self_sight(alone(build(*lidar)))
    assert line.startswith("design.sensors.scan: some of its 360 beams see the robot itself")
    typed = line.rpartition("type ")[2].strip("'")
    assert list(check_self_sight(alone(build(*lidar, typed)))) == []


def test_housings_that_overlap_are_told() -> None:
    region = "{_target_: evoros.design.region.Region, x_m: [0.2, %s], y_m: 0.1, yaw_deg: 0}"
    keys = ["design.regions=null", "design.number=2", "design.mirrored=false"]
    (line,) = check_housings(alone(build(*keys, f"+design.regions.spot={region % 0.201}")))
    assert "sensor housings overlap in all 5 random designs, by up to " in line
    assert "(sonar_0 and sonar_1)" in line
    # Some random designs of the study are free of overlaps, which a search can choose.
    assert list(check_housings(alone(build("experiment=case_study")))) == []


# Courses ------------------------------------------------------------------------------------


def wall(name: str, x: float, y: float, length: float, width: float = 0.1) -> Body:
    return Body(name, Pose((x, y, 0.5)), (Shape("box", (length, width, 1.0)),))


def corridor(width: float, *more: Body, **course: Any) -> Experiment:
    """Build an experiment in a corridor of 20 m along x, from home to a waypoint at 8 m."""
    experiment = build("world=boxes", "course.home_yaw_rad=0", "course.waypoints=[[8,0]]")
    world = experiment.world["boxes"]
    sides = (width + 0.1) / 2
    bodies = (GROUND, wall("left", 0, sides, 20), wall("right", 0, -sides, 20), *more)
    route = replace(world.course, **{"acceptance_m": 0.3, **course})
    return replace(experiment, world={"hall": replace(world, bodies=bodies, course=route)})


def test_a_range_far_beyond_the_free_space_is_told() -> None:
    (line,) = check_routes(alone(corridor(1.0)))
    assert line == (
        "world.hall: half of the course lies within 0.5 m of an obstacle, but "
        "controller.avoidance.range_m is 2 m, so the robot avoids obstacles most of the "
        "time; lower this range to about 1 m"
    )
    assert list(check_routes(alone(corridor(1.5)))) == []


def test_a_passage_narrower_than_the_robot_is_told() -> None:
    """The rover is 0.325 m wide."""

    def door(width: float) -> Experiment:
        length = (2.0 - width) / 2
        posts = [
            Body(f"post{side}", Pose((4, side * (1 - length / 2), 0.5)), (box(0.1, length),))
            for side in (-1, 1)
        ]
        return corridor(2.0, *posts)

    def box(length: float, width: float) -> Shape:
        return Shape("box", (length, width, 1.0))

    ends = [wall(f"end{x}", x, 0, 0.1, 2.2) for x in (-10, 10)]
    closed = door(0.15)
    hall = closed.world["hall"]
    closed = replace(closed, world={"hall": replace(hall, bodies=(*hall.bodies, *ends))})
    (line,) = check_routes(alone(closed))
    assert "(8, 0) is as wide as erle_rover (0.325 m)" in line
    assert "no path between the obstacles from home to the waypoint" in line
    opened = door(0.4).world["hall"]
    opened = replace(opened, bodies=(*opened.bodies, *ends))
    assert list(check_routes(alone(replace(closed, world={"hall": opened})))) == []


def test_waypoints_within_the_acceptance_of_each_other_are_told_once() -> None:
    lines = list(check_routes(alone(build("course.waypoints=[[5,5],[5,5.5]]"))))
    assert len(lines) == 1
    assert lines[0].startswith("world.boxes, world.maze, world.blocks: leg 2 of the course, 0.5 m")
    (line,) = check_routes(alone(corridor(1.5, acceptance_m=8.5)))
    assert "leg 1 of the course" in line


def test_a_waypoint_that_the_robot_cannot_reach_is_told() -> None:
    post = wall("post", 8.2, 0, 0.1)
    (line,) = check_routes(alone(corridor(2.0, post, acceptance_m=0.005)))
    assert "touches an obstacle before it is within acceptance_m (0.005 m)" in line
    assert list(check_routes(alone(corridor(2.0, post, acceptance_m=0.1)))) == []


def test_a_home_at_which_the_robot_touches_an_obstacle_is_refused() -> None:
    """The front of the rover is 0.25 m ahead of its origin."""
    with pytest.raises(
        InputError, match=r"erle_rover touches an obstacle at home \(0, 0\): 'post'; move"
    ):
        list(check_home(alone(corridor(2.0, wall("post", 0.29, 0.8, 0.1, 1.59)))))
    post = wall("post", 0.29, 0, 0.1, 0.1)
    with pytest.raises(InputError, match="touches an obstacle at home"):
        list(check_home(alone(corridor(2.0, post))))
    assert len(list(check_home(alone(corridor(2.0, post, end_on_collision=False))))) == 1
    assert list(check_home(alone(corridor(2.0, wall("post", 0.31, 0, 0.1, 0.1))))) == []
    inside = wall("post", 0.2, 0, 0.1, 0.1)  # far enough that no mission makes sense
    with pytest.raises(InputError, match="touches an obstacle at home"):
        list(check_home(alone(corridor(2.0, inside, end_on_collision=False))))


def test_a_body_above_home_is_told_if_the_robot_does_not_fit_under_it_or_if_it_falls() -> None:
    """The front of the rover, 0.25 m ahead of its origin, is below the plate at 0.2 m to 0.4 m."""
    height = build().robot.height_m

    def plate(bottom: float, mass: float | None = None, x: float = 0.3) -> Experiment:
        shape = Shape("box", (0.2, 1.0, 0.1))
        above = Body("plate", Pose((x, 0.0, bottom + 0.05)), (shape,), mass)
        return corridor(2.0, above, home_z_m=0.08)

    (line,) = check_home(alone(plate(2.0, 10_000.0)))
    assert line == (
        "world.hall (boxes.sdf): 'plate', 10000 kg, its underside at 2 m falls on erle_rover "
        "at home (0, 0); move the body, or home (course.home_x_m, course.home_y_m), or make it "
        "<static>"
    )
    assert list(check_home(alone(plate(2.0)))) == []
    assert list(check_home(alone(plate(2.0, 10_000.0, x=1.0)))) == []
    with pytest.raises(InputError, match=r"touches an obstacle at home \(0, 0\): 'plate', its und"):
        list(check_home(alone(plate(height - 0.01))))
    (line,) = check_home(alone(plate(height + 0.04)))
    assert "starts 0.08 m above the ground at home (0, 0), inside 'plate'" in line
    assert list(check_home(alone(plate(height + 0.09)))) == []


# Engines ------------------------------------------------------------------------------------


def two_wheeler(**simulator: Any) -> Experiment:
    experiment = build("robot=two_wheeler")
    return replace(experiment, simulator=PyBullet(**simulator))


def test_a_step_that_is_too_coarse_is_told_with_one_that_does() -> None:
    (line,) = check_drive(two_wheeler(solver_iterations=2))
    assert line.startswith("simulator: at time_step=0.025, two_wheeler drives 11 % faster")
    advice = re.search(r"set simulator\.time_step=(\S+) simulator\.solver_iterations=(\d+),", line)
    assert advice is not None
    step, iterations = float(advice[1]), int(advice[2])
    assert round(0.1 / step) * step == pytest.approx(0.1)  # it divides the periods
    assert check_drive(two_wheeler(time_step=step, solver_iterations=iterations)) == []


@pytest.mark.slow
def test_a_motion_that_no_step_corrects_is_told() -> None:
    (line,) = check_drive(two_wheeler(wheel_friction=0.005))
    assert "no time step down to 0.00078125 s corrects that; check the" in line
    fast = build(
        "robot=two_wheeler", "robot.drive.max_speed_mps=3", "controller.avoidance.speed_mps=3"
    )
    (line,) = check_drive(replace(fast, simulator=PyBullet()))
    assert "the tightest turn at 3 m/s needs more friction" in line


def test_the_confirming_simulator_is_tried_too() -> None:
    experiment = build("robot=two_wheeler", "confirmation=physics")
    assert experiment.confirmation is not None
    coarse = replace(experiment.confirmation, simulator=PyBullet(solver_iterations=2))
    (line,) = check_drive(replace(experiment, confirmation=coarse))
    assert "set confirmation.simulator.time_step=" in line


def test_missions_have_the_same_bits_after_a_short_drive() -> None:
    experiment = build("world=boxes")
    world = experiment.world["boxes"]

    def drive() -> Array:
        states = np.zeros((60, STATE_SIZE))
        command = np.array([0.3, 0.4])
        with open_alone(PyBullet().open, experiment.robot, world) as simulation:
            for state in states:
                simulation.advance(command, 0.1)
                simulation.observe(state)
        return states

    before = drive()
    assert check_drive(replace(experiment, simulator=PyBullet())) == []
    np.testing.assert_array_equal(drive(), before)


@dataclass(frozen=True)
class Stub(Simulator):
    """An engine whose robot does something else than commanded."""

    fault: str = ""
    time_step: float = 0.05
    turning_x_m: float = 0.0
    packages = ()

    @contextmanager
    def open(self, robots: Sequence[PlacedRobot], world: World) -> Iterator[Any]:
        ((robot, _),) = robots
        if self.fault == "refuse":
            raise SimulationError("no such robot")
        yield StubSimulation(self.fault, robot, self.turning_x_m)


class StubSimulation:
    def __init__(self, fault: str, robot: Robot, turning_x_m: float) -> None:
        self.fault, self.robot = fault, robot
        self.turning_x_m, self.pose = turning_x_m, np.zeros(3)

    def observe(self, state: Array) -> None:
        state[:] = 0.0
        x, y, yaw = self.pose.tolist()
        arm = self.turning_x_m
        state[[X, Y, YAW]] = x - arm * math.cos(yaw), y - arm * math.sin(yaw), yaw
        if self.fault == "lost":
            state[X] = math.nan

    def sense(self, readings: Array) -> None:
        heights = self.robot.sensor_poses[:, 2]
        readings[:] = heights - (0.03 if self.fault == "sink" else 0.0)
        if self.fault == "tip":
            readings += 0.02 * np.arange(len(readings))

    def advance(self, command: Array, duration: float) -> None:
        assert command.shape == (COMMAND_SIZE,)
        speed, lock = (0.0, 0.0) if self.fault == "stand" else command
        if self.fault == "stick" and abs(command[STEERING]) < 0.3:
            lock = 0.0
        if self.fault == "halt" and speed < 0:
            speed *= 0.7
        rate = speed * math.tan(lock) / self.robot.drive.wheelbase_m
        slips = self.fault == "slip" or (self.fault == "skid" and abs(command[STEERING]) > 0.5)
        turn = rate * duration * (0.8 if slips else 1.0)
        heading = self.pose[2] + 0.5 * turn
        self.pose += [*(speed * duration * np.array([np.cos(heading), np.sin(heading)])), turn]
        self.pose[0] += 0.05 * duration if self.fault == "drift" else 0.0


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        ("stand", "two_wheeler hardly drives at all and hardly turns at all; "),
        ("slip", "two_wheeler turns 20 % slower than commanded; "),
        ("stick", "two_wheeler hardly turns at all at quarter lock; "),
        ("halt", "two_wheeler drives backward 30 % slower than commanded; "),
        ("drift", "two_wheeler drifts 50 mm/s at rest"),
        ("sink", "two_wheeler sinks 30 mm into the ground; "),
        ("tip", "two_wheeler stands at a tilt of 24 deg; "),
        ("lost", "two_wheeler has a pose that is not a number; "),
        ("refuse", "simulator: every mission would fail: no such robot"),
    ],
)
def test_each_fault_of_a_motion_has_its_words(fault: str, said: str) -> None:
    (line,) = check_drive(replace(build("robot=two_wheeler"), simulator=Stub(fault)))
    assert said in line


@pytest.mark.slow
def test_skid_steer_in_pybullet_is_told_once_with_the_engine_in_which_it_holds() -> None:
    """PyBullet is right at no step, and MuJoCo was driven before it is proposed."""
    confirmed = ["confirmation=physics", "simulator@confirmation.simulator=pybullet"]
    experiment = build("robot=mule", "design=around", *confirmed)
    coarse = replace(experiment, simulator=PyBullet())
    fine = replace(experiment, simulator=PyBullet(time_step=0.0025, solver_iterations=50))
    keys = "simulator and confirmation.simulator: mule "
    choices = "use simulator=mujoco simulator@confirmation.simulator=mujoco, in which the robot"
    for tried in (coarse, fine):
        (line,) = check_drive(tried)
        assert "because PyBullet limits friction" in line
        assert "simulator.time_step=" not in line
    (line,) = check_drive(fine)
    assert line.startswith(keys)
    assert choices in line
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(advice, "Mujoco", lambda **_: Stub("refuse"))
        (line,) = check_drive(fine)
        assert "simulator=mujoco" in line.rpartition("; ")[2]
        assert line.endswith(" does not help: no such robot")
        assert "use simulator=mujoco" not in line
    assert check_drive(replace(experiment, simulator=Mujoco(), confirmation=None)) == []


@pytest.mark.slow
def test_a_turning_resistance_is_proposed_only_if_it_was_driven_right() -> None:
    """The drive assumes twice the resistance that wheels on this track have."""
    assumed = ["robot=mule", "design=around", "robot.drive.turning_resistance=3"]
    proposed = "evoros/preflight/advice.py robot.drive.turning_resistance={value}"
    (line,) = check_drive(replace(build(*assumed), simulator=PyBullet()))
    assert is_of(line, proposed)
    (typed,) = re.findall(r"robot\.drive\.turning_resistance=[\d.]+", line)
    assert "use simulator=mujoco" in line
    assert check_drive(replace(build(*assumed[:2], typed), simulator=Mujoco())) == []
    (line,) = check_drive(replace(build(*assumed), simulator=Mujoco()))
    assert is_of(line, proposed)
    advice = re.search(r"set robot\.drive\.turning_resistance=(\S+),", line)
    assert advice is not None, line
    right = build(*assumed[:2], f"robot.drive.turning_resistance={advice[1]}")
    assert check_drive(replace(right, simulator=Mujoco())) == []


def test_a_steering_limit_is_proposed_if_only_tight_turns_are_wrong() -> None:
    wrong = ["robot=mule", "design=around"]
    (line,) = check_drive(replace(build(*wrong), simulator=Stub("skid")))
    assert "slower than commanded at full lock; " in line
    assert is_of(line, "evoros/preflight/advice.py robot.drive.steering_limit_rad={limit}")
    typed = re.findall(r"set (\S+), with which", line)[0]
    assert check_drive(replace(build(*wrong, typed), simulator=Stub("skid"))) == []


def test_a_simulator_without_fault_gives_no_warning() -> None:
    assert check_drive(replace(build("robot=two_wheeler"), simulator=Stub())) == []


class OnePool:
    """Calls at once, or fails."""

    workers, shares_files = 1, True

    def __init__(self, error: Exception | None = None) -> None:
        self.error = error
        self.calls = 0

    def submit(self, function: Callable[..., Any], /, *args: Any) -> "Future[Any]":
        self.calls += 1
        future: Future[Any] = Future()
        if self.error is None:
            future.set_result(function(*args))
        else:
            future.set_exception(self.error)
        return future


def test_a_worker_drives_and_the_log_has_its_warnings(caplog: pytest.LogCaptureFixture) -> None:
    pool = OnePool()
    experiment = two_wheeler(solver_iterations=2)
    report_drive(experiment, pool)
    assert [record.getMessage() for record in caplog.records] == [*check_drive(experiment)]
    assert pool.calls == 1


def test_an_engine_that_crashes_its_worker_is_told(caplog: pytest.LogCaptureFixture) -> None:
    report_drive(two_wheeler(), OnePool(WorkerLost("the engine died")))
    (record,) = caplog.records
    assert "the engine died" in record.getMessage()


def test_a_simulator_of_rules_needs_no_drive() -> None:
    pool = OnePool()
    report_drive(build("robot=two_wheeler"), pool)
    assert pool.calls == 0
