"""A controller that is nodes of ROS 2."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, ClassVar

from evoros.base.checks import checked
from evoros.controller.ros_controller import TOPICS, RosController, name_topics

EXPECTED = name_topics("/goal_pose")


@dataclass(frozen=True, kw_only=True)
@checked
class Ros2(RosController):
    """Runs nodes of ROS 2, in lock-step. docs/ros.md describes their topics and parameters."""

    bridge: ClassVar[str] = "ros2"
    topics: Annotated[Mapping[str, str], TOPICS] = field(default_factory=EXPECTED.copy)
