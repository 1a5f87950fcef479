"""ROS 1 nodes as the controller: equal bytes in each run, and one line for each fault."""

import math
import os
import re
import shlex
import shutil
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from busy import busy_cores
from helpers import ROOT, content, tiny

from evoros.base.errors import InputError, LaunchError, PilotLost, SimulationError
from evoros.plugins.ros.ros_controller import Ros1, name_topics
from evoros.plugins.ros.tests.ros1_cases import PYTHON, controller, faulty, node
from evoros.plugins.ros.tests.ros_cases import (
    LOST,
    NODES,
    SENSOR_TICKS,
    SILENT,
    SONARS,
    STYLES,
    TICKS,
    Heard,
    about,
    brief,
    expect,
    fly,
    fly_at_once,
    hear,
    real_time,
    require_nothing_left,
    stamp,
)

pytestmark = pytest.mark.ros(1)


@pytest.fixture(scope="module", autouse=True)
def _nothing_remains() -> Iterator[None]:
    brief()  # before several threads would make it
    with require_nothing_left():
        yield


@pytest.mark.parametrize("style", STYLES)
def test_a_node_gives_what_its_algorithm_gives(style: str) -> None:
    expected = expect(style)
    assert len({step[1:] for step in expected}) > TICKS // 4  # it steers
    assert fly(controller(node("avoid", style))) == expected


@pytest.mark.slow
def test_nodes_on_busy_cores_give_what_their_algorithms_give() -> None:
    with busy_cores():
        flown = fly_at_once({style: controller(node("avoid", style)) for style in STYLES})
    assert flown == {style: expect(style) for style in STYLES}


@pytest.mark.slow
def test_it_does_not_matter_in_what_order_the_system_runs_threads() -> None:
    timer = controller(node("avoid", "timer"))
    with real_time():
        assert fly(timer, ticks=600) == expect("timer", ticks=600)


@pytest.mark.slow
def test_a_graph_of_two_nodes_gives_the_same_bytes_on_busy_cores() -> None:
    graph = controller(node("avoid", "callback", "/wish"), node("limit"))
    steps = fly(graph)
    assert len({step[1:] for step in steps}) > TICKS // 4
    assert steps != expect("callback")
    with busy_cores():
        assert fly(graph) == steps


@pytest.mark.slow
def test_four_missions_at_once_do_not_hear_each_other() -> None:
    avoider = controller(node("avoid", "callback"))
    with ThreadPoolExecutor() as pool:
        flights = [pool.submit(fly, avoider, phase) for phase in range(4)]
        for phase, flight in enumerate(flights):
            assert flight.result() == expect("callback", phase)


@pytest.mark.slow
def test_without_namespaces_each_mission_has_a_port_of_its_own() -> None:
    avoider = controller(node("avoid", "callback"), isolate=False)
    with ThreadPoolExecutor() as pool:
        flights = [pool.submit(fly, avoider, phase) for phase in range(2)]
        for phase, flight in enumerate(flights):
            assert flight.result() == expect("callback", phase)


@pytest.mark.slow
def test_a_step_waits_for_a_command_from_a_node_that_sleeps_by_the_wall_clock() -> None:
    steps = fly(faulty("sleeps", answer="each"), ticks=40)
    assert [mode for mode, _, _ in steps if mode == 0] == [0] * len(LOST)


@pytest.fixture(scope="module")
def heard(tmp_path_factory: pytest.TempPathFactory) -> Heard:
    """The values that a node was told in a mission, and the modes in which it was told."""
    file = tmp_path_factory.mktemp("ros1") / "heard"
    listener = controller(
        node("listen", file),
        parameters={"reach": 1.25, "avoider": {"gains": [1, 2.5], "side": "left", "on": True}},
        topics={**name_topics("/move_base_simple/goal"), "range": "/sonar/{sensor}"},
        modes=["navigating", "avoiding"],
        frame="map",
    )
    return hear(listener, file)


def test_time_begins_at_a_second_and_steps_exactly(heard: Heard) -> None:
    assert about(heard, "clock") == [[stamp(tick)] for tick in range(TICKS)]


def test_each_sonar_reports_at_its_own_period_and_not_while_it_is_silent(heard: Heard) -> None:
    told: list[list[int]] = [[] for _ in range(SONARS)]
    for time, link, reading, *limits in about(heard, "range"):
        sonar = int(re.fullmatch(r"sonar_(\d)", link)[1])  # type: ignore[index]
        told[sonar].append(time)
        assert 0.2 <= reading <= 4.2
        assert limits == pytest.approx([True, math.radians(30.0), 0.06, 4.5])
    ticks = range(0, TICKS, SENSOR_TICKS)
    for sonar, times in enumerate(told):
        assert times == [stamp(t) for t in ticks if sonar != 1 or t not in SILENT]


def test_pose_and_transform_are_told_unless_the_localization_is_silent(heard: Heard) -> None:
    poses, transforms = about(heard, "odometry"), about(heard, "tf")
    assert len(poses) == len(transforms) == TICKS - len(LOST)
    assert all(frame == "map" and child == "base_link" for frame, child, *_ in transforms)
    assert [x for *_, x, _ in transforms] == [x for *_, x in poses]
    assert all(child == "base_link" and speed == rate == 0.0 for child, speed, rate, _ in poses)


def test_the_goal_is_told_when_it_changes_and_the_route_once(heard: Heard) -> None:
    (goal,) = about(heard, "goal")  # the listener does not move
    (route,) = about(heard, "route")
    yaw = math.atan2(0.5, 1.0)
    expected = ["map", 1.0, 0.5, math.sin(yaw / 2), math.cos(yaw / 2)]
    assert goal[0] == stamp(0)
    assert goal[1:] == pytest.approx(expected)
    assert route[0][1:] == pytest.approx(expected)
    assert [pose[2:4] for pose in route] == brief().route.tolist()


def test_the_parameters_are_those_of_the_mission(heard: Heard) -> None:
    ((parameters,),) = about(heard, "parameters")
    assert parameters["/reach"] == 1.25
    assert parameters["/avoider/gains"] == [1, 2.5]
    assert (parameters["/avoider/side"], parameters["/avoider/on"]) == ("left", True)
    assert parameters["/use_sim_time"] is True
    assert parameters["/robot_description"] == brief().robot.urdf
    assert parameters["/evoros/seed"] == brief().seed % 2**31
    assert parameters["/evoros/drive/wheelbase_m"] == brief().robot.drive.wheelbase_m
    poses = [sensor["pose"] for sensor in parameters["/evoros/sensors"]]
    assert poses == brief().robot.sensor_poses.tolist()


def test_the_mode_is_the_reported_one_and_the_first_before(heard: Heard) -> None:
    modes = heard[1]
    assert modes == [1, 1, *(0 if tick in LOST else 2 for tick in range(2, TICKS))]


def test_ackermann_commands_are_taken_where_there_are_such_messages(tmp_path: Path) -> None:
    """The package is generated here, because Debian has none."""
    package = tmp_path / "ackermann_msgs"
    package.mkdir()
    shutil.copy(NODES / "ackermann_kinds.py", package / "msg.py")
    (package / "__init__.py").touch()
    driver = controller(node("ackermann"), environment={"PYTHONPATH": str(tmp_path)})
    assert set(fly(driver, ticks=10)) == {(1, 0.25, -0.125)}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"nodes": []}, "nodes: must be a non-empty list of commands"),
        ({"nodes": "python3 avoid.py"}, "nodes: must be a non-empty list of commands"),
        ({"twist": "curvature"}, "twist: must be one of yaw_rate, steering"),
        ({"answer": "never"}, "answer: must be one of rest, each"),
        (
            {"topics": {**name_topics("/goal"), "range": "/a"}},
            "topics: must be strings that start with /",
        ),
        ({"topics": {"command": "/cmd_vel"}}, "topics: must be strings that start with /"),
    ],
)
def test_a_wrong_setting_is_refused_before_a_run(change: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError) as caught:
        replace(controller(["true"]), **change)
    assert message in str(caught.value)


def test_the_nodes_are_found_from_the_current_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    ros1 = Ros1(nodes=["python3 tests/nodes/ros1_avoid.py rate", ["true", "a b"]])
    script = str(NODES / "ros1_avoid.py")
    assert ros1.nodes == [["python3", script, "rate"], ["true", "a b"]]
    assert script in ros1.files


def test_python3_alone_is_the_python_of_the_controller() -> None:
    command = ["python3", str(NODES / "ros1_avoid.py"), "callback"]
    assert fly(controller(command, python=PYTHON)) == expect("callback")


@pytest.mark.slow
def test_a_run_with_one_worker_and_with_two_gives_the_same_bytes(tmp_path: Path) -> None:
    command = f"{PYTHON} {shlex.quote(str(NODES / 'ros1_avoid.py'))} callback"
    settings = (
        "controller=ros1",
        f'controller.nodes=["{command}"]',
        "+controller.parameters.reach=1.0",
        "~world.far",
        "world.near.course.time_limit_s=8",
        "optimizer.generations=1",
        "optimizer.population_size=2",
    )
    runs = [tmp_path / "one", tmp_path / "two"]
    for workers, run in enumerate(runs, 1):
        parallel = ("executor=processes", f"executor.workers={workers}") if workers > 1 else ()
        assert tiny(run, *settings, *parallel) == 0
    first, second = map(content, runs)
    assert first == second


FAULTS = {
    "dies": (PilotLost, r"faulty.py'? dies exited with status 7"),
    "closes": (PilotLost, r"a node no longer publishes on /cmd_vel"),
    "stops": (PilotLost, r"did not come to rest: .*faulty.py'? stops"),
    "spins": (PilotLost, r"did not come to rest: .*faulty.py'? spins"),
    "hides": (PilotLost, r"cannot read what the process .*faulty.py'? hides is waiting for"),
    "nan": (SimulationError, r"NaN.* at 1.9 s; it must send"),
    "infinite": (SimulationError, r"Infinity.* at 1.9 s; it must send"),
    "mode": (SimulationError, r"dancing.* at 1.9 s; it must send"),
}


@pytest.fixture(scope="module")
def endings(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Exception | None]:
    """How missions with each fault ended."""
    python = tmp_path_factory.mktemp("bin") / "python3"
    command = f"setpriv --bounding-set=-sys_ptrace {PYTHON}" if os.geteuid() == 0 else PYTHON
    python.write_text(f'#!/bin/sh\nexec {command} "$@"\n')  # root may look at all processes
    python.chmod(0o755)
    changes: dict[str, dict[str, Any]] = {"hides": {"python": str(python)}}
    return end_all({fault: faulty(fault, **changes.get(fault, {})) for fault in FAULTS})


def end_all(controllers: dict[str, Ros1]) -> dict[str, Exception | None]:
    """The error with which a mission of each controller ended; four missions at once."""
    with ThreadPoolExecutor(4) as pool:
        flights = {name: pool.submit(fly, item) for name, item in controllers.items()}
        return {name: flight.exception() for name, flight in flights.items()}  # type: ignore[misc]


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_in_mid_mission_ends_it_with_one_line(
    fault: str, endings: dict[str, Exception | None]
) -> None:
    kind, message = FAULTS[fault]
    error = endings[fault]
    assert type(error) is kind
    assert re.search(message, str(error))
    assert "1.9" in str(error)
    assert "\n" not in str(error)


NO_ROS: dict[str, Any] = {"python": sys.executable}
QUICK: dict[str, Any] = {"start_limit_s": 30.0}
REFUSED: dict[str, tuple[list[str], dict[str, Any], str]] = {
    "no rospy": (node("avoid", "rate"), NO_ROS, "controller.python: must be a Python with ROS 1"),
    "no command": ([str(NODES / "avoid.py")], {}, "controller.nodes: this system cannot execute"),
    "no node": (node("faulty", "no_node"), QUICK, "no_node has started no node"),
    "deaf": (node("faulty", "deaf"), QUICK, "no node subscribes to /move_base_simple/goal, /odom"),
    "mute": (node("avoid", "rate", "/wish"), QUICK, "no node publishes on /cmd_vel"),
    "point": (node("faulty", "point"), {}, "/cmd_vel: messages must be Twist or"),
    "parameter": (
        node("avoid", "rate"),
        {"parameters": {"gain": None}},
        "controller.parameters.gain: must be a number, a string",
    ),
}


@pytest.fixture(scope="module")
def refusals() -> dict[str, Exception | None]:
    """How missions with each unfit node ended."""
    return end_all({case: controller(node, **more) for case, (node, more, _) in REFUSED.items()})


@pytest.mark.parametrize("case", REFUSED)
def test_nodes_that_cannot_control_are_refused_in_one_line(
    case: str, refusals: dict[str, Exception | None]
) -> None:
    error = refusals[case]
    assert type(error) is LaunchError
    assert REFUSED[case][2] in str(error)
    assert "\n" not in str(error)


def test_two_nodes_that_command_are_refused_by_their_names() -> None:
    two = controller(node("avoid", "rate"), node("limit"))
    with pytest.raises(LaunchError, match=r"/cmd_vel: must have one publisher, not 2 \(/avoid"):
        fly(two)


def test_a_node_that_fails_at_its_start_says_why() -> None:
    with pytest.raises(PilotLost, match=r"there is no map.*exited with status 1"):
        fly(faulty("fails"))
