"""Nodes of ROS 1 that fail, hang or do not fit: each mission ends with one line that says why."""

import os
import re
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest

from evoros.base.errors import LaunchError, PilotLost, SimulationError
from evoros.plugins.ros.ros_controller import Ros1
from evoros.plugins.ros.tests.ros1_cases import PYTHON, controller, faulty, node
from evoros.plugins.ros.tests.ros_cases import NODES, brief, fly, require_nothing_left

pytestmark = pytest.mark.ros(1)


@pytest.fixture(scope="module", autouse=True)
def _nothing_remains() -> Iterator[None]:
    brief()  # before several threads would make it
    with require_nothing_left():
        yield


FAULTS = {
    "dies": (PilotLost, r"faulty.py'? dies exited with status 7"),
    "closes": (PilotLost, r"a node no longer publishes on /cmd_vel"),
    "stops": (PilotLost, r"did not come to rest: .*faulty.py'? stops"),
    "spins": (PilotLost, r"did not come to rest: .*faulty.py'? spins"),
    "hides": (PilotLost, r"what the process .*faulty.py'? hides waits for is hidden"),
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
QUICK: dict[str, Any] = {"start_limit_s": 10.0}
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
