"""Nodes of ROS 1 as controllers for the tests."""

from typing import Any

from evoros.plugins.ros.ros_controller import Ros1
from evoros.plugins.ros.tests.ros_cases import NODES, REACH_M

PYTHON = "/usr/bin/python3"


def node(name: str, *arguments: object) -> list[str]:
    return [PYTHON, str(NODES / f"ros1_{name}.py"), *map(str, arguments)]


def controller(*nodes: list[str], **changes: Any) -> Ros1:
    settings = {"parameters": {"reach": REACH_M}, "start_limit_s": 60.0, "answer_limit_s": 30.0}
    return Ros1(nodes=nodes, **{**settings, **changes})


def faulty(fault: str, **changes: Any) -> Ros1:
    return controller(node("faulty", fault), **{"answer_limit_s": 5.0, **changes})
