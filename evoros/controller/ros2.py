"""A controller that is nodes of ROS 2."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, ClassVar

from evoros.base.checks import TEXT, checked
from evoros.controller.ros_controller import TOPICS, RosController

EXPECTED = {
    "command": "/cmd_vel",
    "goal": "/goal_pose",
    "mode": "/mode",
    "odometry": "/odom",
    "range": "/{sensor}",
    "route": "/route",
}
"""The topics on which nodes of ROS 2 usually expect them."""


@dataclass(frozen=True, kw_only=True)
@checked
class Ros2(RosController):
    """Runs nodes of ROS 2, in lock-step. docs/ros.md describes what they are told.

    Raises:
        InputError: a value breaks its rule.
    """

    bridge: ClassVar[str] = "ros2.py"
    python: Annotated[str, TEXT] = "/usr/bin/python3"
    topics: Annotated[Mapping[str, str], TOPICS] = field(default_factory=EXPECTED.copy)
