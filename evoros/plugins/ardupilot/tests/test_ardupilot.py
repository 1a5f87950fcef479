"""A real autopilot as the controller, or the peer that stands in for it."""

import json
import math
import signal
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields, replace
from hashlib import sha256
from pathlib import Path
from typing import cast

import numpy as np
import pytest
from busy import busy_cores
from fixture_types import Folders, Log, Patch
from helpers import alone, content, with_parts
from pybullet_cases import box

from evoros.base.errors import InputError, LaunchError, PilotLost
from evoros.cli.main import evoros
from evoros.controller.ardupilot_parameters import derive_parameters
from evoros.controller.protocol import Briefing
from evoros.controller.weighted_voting import WeightedVoting
from evoros.design.genes import replace_values
from evoros.evolution.experiment import Experiment
from evoros.filter.delay import Delay
from evoros.mission.rollout import run_mission
from evoros.mission.scenario import Scenario
from evoros.plugins.ardupilot import mavlink
from evoros.plugins.ardupilot.controller import ArduPilot
from evoros.plugins.ardupilot.tests.ardupilot_cases import (
    PERIOD_S,
    REAL,
    VERSION,
    Interrupted,
    compose_experiment,
    find_processes,
    make_binary,
    mission,
    open_field,
    with_fault,
    with_settings,
)
from evoros.preflight.preflight import check_told, preflight

SHORT_S = 4.0
LAST_TICK = round(SHORT_S / PERIOD_S) - 1
AVOIDING_S = 15.0
BOX_M = 1.0, 1.0, 1.0
of_the_peer = pytest.mark.skipif(REAL is not None, reason="only the peer has faults to inject")


@pytest.fixture(scope="module")
def binary(tmp_path_factory: Folders) -> Iterator[Path]:
    path = make_binary(tmp_path_factory.mktemp("a binary"))
    yield path
    assert not find_processes(path)


@pytest.fixture(scope="module")
def experiment(binary: Path) -> Experiment:
    return compose_experiment(binary, "simulator=planar")


@pytest.fixture(scope="module")
def short(experiment: Experiment) -> Scenario:
    """Four seconds in the open."""
    return open_field(experiment, SHORT_S)


@pytest.fixture(scope="module")
def among_boxes(experiment: Experiment) -> Scenario:
    """Into avoidance, which begins after some 4 s: the box comes within reach at 1 m of the leg."""
    return beside_a_box(experiment, AVOIDING_S)


def beside_a_box(experiment: Experiment, limit_s: float) -> Scenario:
    """A scenario with a box beside the first leg, which the robot avoids."""
    scenario = open_field(experiment, limit_s)
    world = scenario.world["boxes"]
    (x, y), (to_x, to_y) = world.course.home[:2], world.course.route(True)[0]
    obstacle = box("box", x + 0.5 * (to_x - x) + 0.3, y + 0.5 * (to_y - y) + 0.3, BOX_M)
    return replace(scenario, world={"boxes": replace(world, bodies=(*world.bodies, obstacle))})


def bound_first_leg(experiment: Experiment) -> float:
    """Return a time within which any autopilot ends the first leg, despite the box.

    The box stays within reach for at most its diagonal and twice the range of the avoidance, if
    the robot passes it once. At the worst, the avoidance drives this way straight off the waypoint.
    Then the robot turns round, and has the leg and all of this way before it.
    """
    controller, drive = cast(ArduPilot, experiment.controller), experiment.robot.drive
    avoidance, course = cast(WeightedVoting, controller.avoidance), experiment.world["boxes"].course
    leg = math.dist(course.home[:2], course.route(True)[0])
    passing = math.hypot(*BOX_M[:2]) + 2.0 * avoidance.range_m
    turning = math.pi * drive.wheelbase_m / (drive.turn_ratio * math.tan(drive.steering_limit))
    back = (leg + passing + turning) / controller.parameters["WP_SPEED"]
    return float(math.ceil(passing / avoidance.speed_mps + back))


def digest(scenario: Scenario) -> str:
    (outcome,), track = run_mission(scenario, mission())
    return sha256(track.tobytes() + repr(outcome).encode()).hexdigest()


@pytest.fixture(scope="module")
def reference(among_boxes: Scenario) -> str:
    return digest(among_boxes)


@pytest.mark.parametrize("simulator", ["planar", pytest.param("pybullet", marks=pytest.mark.slow)])
def test_all_ten_waypoints_count_in_the_open(binary: Path, simulator: str) -> None:
    scenario = open_field(compose_experiment(binary, f"simulator={simulator}"))
    (outcome,), _ = run_mission(scenario, mission())
    assert (outcome.visited, outcome.ended, outcome.collisions) == (10, "completed", 0)
    assert outcome.avoiding == 0.0


@pytest.mark.slow
def test_it_avoids_and_goes_on_with_its_route(experiment: Experiment) -> None:
    scenario = beside_a_box(experiment, bound_first_leg(experiment))
    (outcome,), track = run_mission(scenario, mission())
    modes = track[:, 6]
    changes = modes[np.flatnonzero(np.diff(modes, prepend=0.0))].tolist()
    assert changes[:3] == [2.0, 1.0, 2.0]
    assert 0.0 < outcome.avoiding < 1.0
    assert outcome.collisions == 0
    assert outcome.visited > 0


def test_a_parameter_may_evolve(short: Scenario) -> None:
    slow_member = replace_values(short.members[0], {"controller.parameters.WP_SPEED": 0.2})
    slower = replace(short, members=(slow_member,))
    (slow,), (fast,) = (run_mission(scenario, mission())[0] for scenario in (slower, short))
    assert slow.max_speed_mps < 0.25 < fast.max_speed_mps


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["two_wheeler", "mule"])
def test_a_robot_without_steering_is_a_car_to_it(binary: Path, robot: str) -> None:
    choices = ["simulator=planar", f"robot={robot}", "design=around", "robot.mount=null"]
    scenario = open_field(compose_experiment(binary, *choices), 60.0)
    (outcome,), _ = run_mission(scenario, mission(0))
    assert outcome.visited >= 1


@pytest.mark.slow
def test_two_missions_have_the_same_bytes(among_boxes: Scenario, reference: str) -> None:
    assert digest(among_boxes) == reference


def test_without_isolation_the_bytes_are_the_same_and_no_file_is_left(
    among_boxes: Scenario, reference: str, tmp_path: Path, monkeypatch: Patch
) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    assert digest(with_settings(among_boxes, isolate=False)) == reference
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_missions_at_once_do_not_hear_each_other(among_boxes: Scenario, reference: str) -> None:
    with ThreadPoolExecutor(2) as pool:
        assert set(pool.map(digest, [among_boxes] * 2)) == {reference}


@pytest.mark.slow
def test_one_and_two_workers_leave_the_same_bytes(binary: Path, tmp_path: Path) -> None:
    run = ["world=boxes", "simulator=planar", "controller=ardupilot", f"controller.binary={binary}"]
    search = ["optimizer.population_size=2", "optimizer.generations=1", "figures=[]"]
    limits = ["course.time_limit_s=2", "optimizer.validation_trials=1"]
    folders = [tmp_path / "one", tmp_path / "two"]
    for folder, workers in zip(folders, ("executor=serial", "executor.workers=2"), strict=True):
        assert evoros([*run, *search, *limits, workers, f"hydra.run.dir={folder}"]) == 0
    one, two = map(content, folders)
    assert one == two
    manifest = json.loads((folders[0] / "manifest.json").read_text())
    assert manifest["programs"][str(binary)].startswith("ArduRover V")
    assert manifest["sha256"][f"file {binary}"] == sha256(binary.read_bytes()).hexdigest()


@pytest.mark.slow
def test_a_busy_machine_changes_no_byte(among_boxes: Scenario, reference: str) -> None:
    with busy_cores():
        assert digest(among_boxes) == reference


@pytest.mark.slow
@of_the_peer
@pytest.mark.parametrize("fault", ["miss@0", "miss@auto+70", "slow@auto+500:0.004", "noise@auto+9"])
def test_a_fault_of_the_transport_changes_no_byte(
    among_boxes: Scenario, reference: str, fault: str
) -> None:
    assert digest(with_settings(among_boxes, environment={"PEER_FAULT": fault})) == reference


@pytest.mark.parametrize("tick", [0, 100, LAST_TICK])
def test_a_killed_autopilot_is_lost_at_its_time(short: Scenario, tick: int) -> None:
    with pytest.raises(PilotLost, match=rf"ended by signal 9 .*at {tick * PERIOD_S:g} simulated s"):
        run_mission(interrupted(short, tick, signal.SIGKILL), mission())


@pytest.mark.slow
@pytest.mark.parametrize("tick", [0, LAST_TICK])
def test_a_stopped_autopilot_is_lost_at_its_time(short: Scenario, tick: int) -> None:
    slow = with_settings(short, answer_limit_s=4.0)
    message = rf"sent no servo outputs within 4 s at {tick * PERIOD_S:g} simulated s"
    with pytest.raises(PilotLost, match=message):
        run_mission(interrupted(slow, tick, signal.SIGSTOP), mission())


def interrupted(scenario: Scenario, tick: int, sent: signal.Signals) -> Scenario:
    inner = cast(ArduPilot, scenario.members[0].controller)
    settings = {field.name: getattr(inner, field.name) for field in fields(inner)}
    return with_parts(scenario, controller=Interrupted(**settings, tick=tick, number=sent))


@of_the_peer
@pytest.mark.parametrize(
    ("fault", "message"),
    [
        (
            "die@0",
            "ended with exit status 1 before the mission started; .*Floating point exception",
        ),
        ("die@30", "ended with exit status 1 before the mission started"),
        ("die@auto+1", "ended with exit status 1 at 0 simulated s"),
        (f"die@auto+{LAST_TICK + 1}", f"ended with exit status 1 at {SHORT_S - PERIOD_S:g} sim"),
        ("crash@auto+51", r"ended by signal 11 \(Segmentation fault\) at 1 simulated s"),
        ("hang@0", "sent no servo outputs within 2 s of its start before the mission started"),
        ("hang@auto+1", "sent no servo outputs within 4 s at 0 simulated s"),
        ("stop@auto+101", "sent no servo outputs within 4 s at 2 simulated s"),
        ("unlink@auto+50", "closed MAVLink at 1 simulated s"),
    ],
)
def test_a_lost_autopilot_is_told_with_time_status_and_last_words(
    short: Scenario, fault: str, message: str
) -> None:
    limit = 2.0 if fault == "hang@0" else 60.0
    with pytest.raises(PilotLost, match=message):
        run_mission(with_settings(with_fault(short, fault), start_limit_s=limit), mission())


@of_the_peer
@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ("rubbish@0", "sent a packet that begins with 0, not 18458 before the mission started"),
        ("rubbish@auto+1", "sent a packet that begins with 0, not 18458 at 0 simulated s"),
        ("short@auto+51", "sent a packet of 20 bytes at 1 simulated s"),
        ("steering@auto+51:65535", "sent a servo pulse of 65535 us at 1 simulated s"),
        (f"throttle@auto+{LAST_TICK + 1}:799", "sent a servo pulse of 799 us at 3.98 simulated s"),
    ],
)
def test_what_cannot_be_used_fails_the_simulation_at_its_time(
    short: Scenario, fault: str, message: str
) -> None:
    (outcome,), _ = run_mission(with_fault(short, fault), mission())
    assert outcome.ended == "simulation_failure"
    assert message in outcome.reason


@of_the_peer
def test_a_servo_without_pulse_leaves_the_last_command(short: Scenario) -> None:
    (outcome,), track = run_mission(with_fault(short, "steering@auto+51:0"), mission())
    assert outcome.ended == "time_limit"
    assert set(track[:, 6].tolist()) <= {0.0, 2.0}


@of_the_peer
def test_one_that_is_never_ready_is_refused_with_what_it_said(short: Scenario) -> None:
    deaf = with_settings(with_fault(short, "deaf@0"), warm_up_s=2.0)
    with pytest.raises(InputError, match="did not send a heartbeat within 2 simulated s"):
        run_mission(deaf, mission())


@of_the_peer
def test_one_that_does_not_arm_is_refused_with_its_reason(short: Scenario) -> None:
    controller = cast(ArduPilot, short.members[0].controller)
    parameters = {**controller.parameters, "SCHED_LOOP_RATE": 200}
    eager = with_settings(short, parameters=parameters, warm_up_s=6.0)
    with pytest.raises(InputError, match=r"did not arm within 6 .*Main loop slow \(50Hz < 200Hz\)"):
        run_mission(eager, mission())


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"arguments": ("--nonsense",)}, PilotLost, "ended with exit status .* before the mission"),
        ({"parameters": {"WP_SPEED": 0.0}}, InputError, "WP_SPEED: must be greater than 0, not 0"),
    ],
)
def test_what_it_cannot_start_with_is_told(
    short: Scenario, changes: dict[str, object], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        run_mission(with_settings(short, **changes), mission())


def test_an_unknown_parameter_is_refused_by_its_name(short: Scenario) -> None:
    controller = cast(ArduPilot, short.members[0].controller)
    misspelt = with_settings(short, parameters={**controller.parameters, "WP_SPED": 0.3})
    with pytest.raises(InputError, match=r"controller\.parameters\.WP_SPED: not a parameter"):
        run_mission(misspelt, mission())


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"period_s": 0.025}, r"at most 0.02 \(ArduPilot does not arm at fewer than 50"),
        ({"avoidance_period_s": 0.05}, "must be a whole multiple of period_s .*set it to 0.04"),
        ({"localization": {"late": Delay()}}, r"must be empty .* not \['late'\]; choose .*=exact"),
        ({"parameters": {"wp_speed": 1}}, "a mapping from ArduPilot parameter names"),
        ({"parameters": {"WP_SPEED": math.nan}}, "a mapping from ArduPilot parameter names"),
        ({"binary": ""}, "must be a non-empty string"),
    ],
)
def test_a_bad_value_is_one_line(short: Scenario, changes: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        with_settings(short, **changes)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["missing", "no_program"])
def test_a_binary_that_cannot_be_started_is_named(
    short: Scenario, tmp_path: Path, name: str
) -> None:
    (tmp_path / "no_program").write_text("text")
    with pytest.raises(LaunchError, match=f"{name}: cannot be executed"):
        run_mission(with_settings(short, binary=str(tmp_path / name)), mission())


def test_without_pymavlink_its_installation_is_told(short: Scenario, monkeypatch: Patch) -> None:
    mavlink.dialect.cache_clear()
    monkeypatch.setitem(sys.modules, "pymavlink.dialects.v20", None)
    with pytest.raises(LaunchError, match=r"pymavlink, .*'evoros\[ardupilot\]'"):
        run_mission(short, mission())
    mavlink.dialect.cache_clear()


def test_parameters_follow_from_the_robot_and_the_mission(short: Scenario) -> None:
    robot = short.members[0].with_design(mission(7).design).robot
    robot = replace(robot, mounts=robot.mounts[::-1])  # the first one looks to the left
    route, drive = np.zeros((1, 2)), robot.drive
    briefing = Briefing(robot, (0.0, 0.0, 0.0, 0.0), route, 1.0, 10.0, 0)
    derived = derive_parameters(briefing, {"WP_SPEED": 0.25, "WP_RADIUS": 2.0})
    lock_rate = 0.25 * math.tan(drive.steering_limit) / drive.wheelbase_m
    assert derived["ATC_STR_RAT_FF"] == pytest.approx(1.0 / lock_rate)
    assert derived["PSC_VEL_P"] == pytest.approx(4.0)
    assert derived["TURN_RADIUS"] == pytest.approx(0.25 / lock_rate)
    full = 100.0 / derived["CRUISE_THROTTLE"] * derived["CRUISE_SPEED"]
    assert full == pytest.approx(drive.max_speed_mps)
    assert not {"WP_SPEED", "WP_RADIUS", "RNGFND7_TYPE"} & derived.keys()
    left, forward, half_right = 6, 0, 1
    assert derived["RNGFND1_ORIENT"] == left
    assert derived["RNGFND4_ORIENT"] == forward
    assert derived["RNGFND5_ORIENT"] == half_right
    x, y, z = robot.sensor_poses[0, :3].tolist()
    assert [derived[f"RNGFND1_POS_{axis}"] for axis in "XYZ"] == [x, -y, -z]
    assert derived["RNGFND1_MAX_CM"] == 100.0 * derived["RNGFND1_MAX"]


@of_the_peer
def test_the_version_is_that_of_the_binary(short: Scenario) -> None:
    controller = cast(ArduPilot, short.members[0].controller)
    assert controller.version == VERSION
    assert controller.files == (controller.binary,)


@pytest.mark.slow
def test_more_than_six_sonars_are_said_once_before_the_run(
    experiment: Experiment, binary: Path, caplog: Log
) -> None:
    assert list(check_told(alone(experiment))) == []
    caplog.set_level("INFO", "evoros")
    preflight(compose_experiment(binary, "simulator=planar", "design.number=4"))
    told = [line for line in caplog.messages if "the program receives" in line]
    assert told == [
        "controller: the program receives only the readings of a design's first 6 sensors, but "
        "designs have up to 8; the controller's layers receive all readings"
    ]
