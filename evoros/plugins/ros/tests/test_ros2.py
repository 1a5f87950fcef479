"""ROS 2 nodes as the controller: their messages and commands, with equal bytes in each run."""

import re
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from busy import busy_cores
from documents import DOCS
from helpers import content, tiny
from needs import ROS2_PYTHON

from evoros.base.errors import LaunchError, PilotLost, SimulationError
from evoros.plugins.ros.ros_controller import Ros2, name_topics
from evoros.plugins.ros.tests.ros_cases import (
    LOST,
    NODES,
    REACH_M,
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
    require_nothing_left,
    stamp,
)

SHARED_MEMORY = Path("/dev/shm")
pytestmark = pytest.mark.ros(2)


@pytest.fixture(scope="module", autouse=True)
def _nothing_remains() -> Iterator[None]:
    brief()  # composed once, before there are threads
    before = set(SHARED_MEMORY.iterdir())
    with require_nothing_left():
        yield
    remaining = {path.name for path in set(SHARED_MEMORY.iterdir()) - before}
    assert not any("fastdds" in name or "fastrtps" in name for name in remaining)


def node(name: str, *arguments: object) -> list[str]:
    return [str(ROS2_PYTHON), str(NODES / f"ros2_{name}.py"), *map(str, arguments)]


def controller(*nodes: list[str], **changes: Any) -> Ros2:
    settings = {"parameters": {"reach": REACH_M}, "start_limit_s": 60.0, "answer_limit_s": 30.0}
    return Ros2(nodes=nodes, **{"python": str(ROS2_PYTHON), **settings, **changes})


def faulty(fault: str, **changes: Any) -> Ros2:
    return controller(node("faulty", fault), **{"answer_limit_s": 4.0, **changes})


@pytest.mark.slow
def test_nodes_on_busy_cores_give_what_their_algorithms_give() -> None:
    with busy_cores():
        flown = fly_at_once({style: controller(node("avoid", style)) for style in STYLES})
    assert flown == {style: expect(style, first_end=0) for style in STYLES}


@pytest.mark.slow
def test_a_command_may_start_its_node_as_a_process_of_its_own() -> None:
    program, script, style = node("avoid", "callback")
    runner = ["sh", "-c", f'"{program}" "{script}" {style} "$@" & wait', "run"]
    launcher = [
        "sh",
        "-c",
        f'"{program}" "{script}" {style} --ros-args --params-file {{parameters}}',
    ]
    for command in (runner, launcher):
        assert fly(controller(command)) == expect("callback")


@pytest.mark.slow
def test_a_graph_of_two_nodes_gives_the_same_bytes_on_busy_cores() -> None:
    avoid = [*node("avoid", "callback"), "--ros-args", "-r", "cmd_vel:=wish"]
    first, second = controller(avoid, node("limit")), controller(node("limit"), avoid)
    steps = fly(first)
    assert len({step[1:] for step in steps}) > TICKS // 4
    late = fly(second)
    assert late != steps  # the message goes to one node after the other
    with busy_cores():
        assert fly(first) == steps


@pytest.mark.slow
@pytest.mark.parametrize("isolate", [True, False])
def test_missions_at_once_do_not_hear_each_other(isolate: bool) -> None:
    avoider = controller(node("avoid", "callback"), isolate=isolate)
    with ThreadPoolExecutor() as pool:
        flights = [pool.submit(fly, avoider, phase) for phase in range(2)]
        for phase, flight in enumerate(flights):
            assert flight.result() == expect("callback", phase)


@pytest.mark.slow
def test_a_step_waits_for_a_command_from_a_node_that_sleeps_by_the_wall_clock() -> None:
    steps = fly(faulty("sleeps", answer="each"), ticks=min(LOST))
    assert {mode for mode, _, _ in steps} == {1}


@pytest.fixture(scope="module")
def heard(tmp_path_factory: pytest.TempPathFactory) -> Heard:
    """The values that a node was told in a mission, and the modes in which it was told."""
    file = tmp_path_factory.mktemp("ros2") / "heard"
    listener = controller(
        node("listen", file),
        parameters={"reach": 1.25, "gains": [1.0, 2.5], "side": {"left": True, "text": "a 'b' é"}},
        topics={**name_topics("/goal_pose"), "range": "/sonar/{sensor}"},
        modes=["navigating", "avoiding"],
        frame="map",
    )
    return hear(listener, file)


def test_time_begins_at_a_second_and_steps_exactly(heard: Heard) -> None:
    assert about(heard, "clock") == [[stamp(tick)] for tick in range(TICKS)]


def test_the_sonars_report_in_the_order_in_which_the_node_subscribed(heard: Heard) -> None:
    expected = [
        [stamp(tick), f"sonar_{sonar}"]
        for tick in range(0, TICKS, SENSOR_TICKS)
        for sonar in reversed(range(SONARS))
        if sonar != 1 or tick not in SILENT
    ]
    assert [values[:2] for values in about(heard, "range")] == expected


def test_the_pose_is_told_unless_the_localization_is_silent(heard: Heard) -> None:
    poses = about(heard, "odometry")
    assert len(poses) == TICKS - len(LOST)
    assert all(child == "base_link" and speed == rate == 0.0 for child, speed, rate, _ in poses)


def test_the_goal_is_told_when_it_changes_and_the_route_once(heard: Heard) -> None:
    (goal,) = about(heard, "goal")  # the listener does not move
    (route,) = about(heard, "route")
    assert goal[:4] == [stamp(0), "map", 1.0, 0.5]
    assert [pose[2:4] for pose in route] == brief().route.tolist()


def test_the_parameters_are_those_of_the_mission(heard: Heard) -> None:
    ((parameters,),) = about(heard, "parameters")
    briefing = brief()
    assert (parameters["reach"], parameters["gains"]) == (1.25, [1.0, 2.5])
    assert (parameters["side.left"], parameters["side.text"]) == (True, "a 'b' é")
    assert parameters["use_sim_time"] is True
    assert parameters["robot_description"] == briefing.robot.urdf
    assert parameters["evoros.seed"] == briefing.seed
    assert parameters["evoros.drive.wheelbase_m"] == briefing.robot.drive.wheelbase_m
    assert parameters["evoros.route"] == briefing.route.ravel().tolist()
    poses = [parameters[f"evoros.{name}.pose"] for name in parameters["evoros.sensors"]]
    assert poses == briefing.robot.sensor_poses.tolist()


def test_the_mode_is_the_reported_one_and_the_first_before(heard: Heard) -> None:
    assert heard[1] == [1, 1, *(0 if tick in LOST else 2 for tick in range(2, TICKS))]


FAULTS: dict[str, tuple[type[Exception], str]] = {
    "dies": (PilotLost, r"faulty.py'? dies exited with status 7"),
    "stops": (PilotLost, r"did not come to rest: .*faulty.py'? stops"),
    "spins": (PilotLost, r"did not come to rest: .*faulty.py'? spins"),
    "nan": (SimulationError, r"NaN.* at 1.9 s; it must send"),
    "mode": (SimulationError, r"dancing.* at 1.9 s; it must send"),
}


@pytest.fixture(scope="module")
def errors() -> dict[str, Exception]:
    """How a mission with each fault ends; at once, because some wait for what does not come."""

    def error(fault: str) -> Exception:
        with pytest.raises(FAULTS[fault][0]) as caught:
            fly(faulty(fault))
        return caught.value

    with ThreadPoolExecutor(len(FAULTS)) as pool:
        return dict(zip(FAULTS, pool.map(error, FAULTS), strict=True))


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_in_mid_mission_ends_it_with_one_line(
    fault: str, errors: dict[str, Exception]
) -> None:
    message = str(errors[fault])
    assert re.search(FAULTS[fault][1], message)
    assert "1.9" in message
    assert "\n" not in message


QUICK = {"start_limit_s": 30.0}
REFUSED: dict[str, tuple[list[str], dict[str, Any], str]] = {
    "no rclpy": (
        node("avoid", "rate"),
        {"python": sys.executable},
        "controller.python: must be a Python with ROS 2",
    ),
    "no command": ([str(NODES / "avoid.py")], {}, "controller.nodes: this system cannot execute"),
    "no node": (node("faulty", "no_node"), QUICK, "no_node has started no node"),
    "wall clock": (
        node("faulty", "wall_clock"),
        QUICK,
        "has started no node that follows simulated time",
    ),
    "deaf": (node("faulty", "deaf"), QUICK, "no node subscribes to /goal_pose, /odom, /route"),
    "mute": (
        [*node("avoid", "rate"), "--ros-args", "-r", "cmd_vel:=wish"],
        QUICK,
        "no node publishes on /cmd_vel",
    ),
    "blocks": (node("faulty", "blocks"), QUICK, "the node /faulty does not answer"),
    "point": (node("faulty", "point"), {}, "/cmd_vel: messages must be Twist or"),
    "parameter": (
        node("avoid", "rate"),
        {"parameters": {"gain": [1, "a"]}},
        "controller.parameters.gain: must be a number, a string",
    ),
}


@pytest.fixture(scope="module")
def refusals() -> dict[str, str]:
    """The error of each case; at once, because most wait for what does not come."""

    def refusal(case: str) -> str:
        command, changes, _ = REFUSED[case]
        with pytest.raises(LaunchError) as caught:
            fly(controller(command, **changes))
        return str(caught.value)

    with ThreadPoolExecutor(len(REFUSED)) as pool:
        return dict(zip(REFUSED, pool.map(refusal, REFUSED), strict=True))


@pytest.mark.parametrize("case", REFUSED)
def test_nodes_that_cannot_control_are_refused_in_one_line(
    case: str, refusals: dict[str, str]
) -> None:
    assert REFUSED[case][2] in refusals[case]
    assert "\n" not in refusals[case]


@pytest.mark.slow
def test_two_nodes_that_command_are_refused_by_their_names() -> None:
    two = controller(node("avoid", "callback"), node("limit"))
    with pytest.raises(
        LaunchError, match=re.escape("must have one publisher, not 2 (avoider, limiter)")
    ):
        fly(two)


def test_a_node_that_fails_at_its_start_says_why() -> None:
    with pytest.raises(PilotLost, match=r"there is no map.*exited with status 1"):
        fly(faulty("fails"))


@pytest.mark.slow
def test_the_node_of_the_page_drives() -> None:
    node = DOCS / "examples" / "avoid2.py"
    steps = fly(controller([str(ROS2_PYTHON), str(node)], parameters={"reach": 0.3}))
    speed = 0.4 * brief().robot.drive.max_speed_mps
    assert {step[:2] for step in steps} == {(1, speed), (0, speed)}
    assert len({steering for *_, steering in steps}) > 3


@pytest.mark.slow
def test_a_run_with_one_worker_and_with_two_gives_the_same_bytes(tmp_path: Path) -> None:
    settings = (
        "controller=ros2",
        f"controller.python={ROS2_PYTHON}",
        f"controller.nodes=[[{ROS2_PYTHON},{NODES / 'ros2_avoid.py'},callback]]",
        "+controller.parameters.reach=1.0",
        "~world.far",
        "world.near.course.time_limit_s=4",
        "optimizer.generations=1",
        "optimizer.population_size=2",
    )
    runs = [tmp_path / "one", tmp_path / "two"]
    for workers, run in enumerate(runs, 1):
        parallel = ("executor=processes", f"executor.workers={workers}") if workers > 1 else ()
        assert tiny(run, *settings, *parallel) == 0
    first, second = map(content, runs)
    assert first == second
