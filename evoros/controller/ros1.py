"""A controller that is nodes of ROS 1."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, ClassVar

from evoros.base.checks import checked
from evoros.controller.ros_controller import TOPICS, RosController, name_topics

EXPECTED = name_topics("/move_base_simple/goal")


@dataclass(frozen=True, kw_only=True)
@checked
class Ros1(RosController):
    """Runs nodes of ROS 1, in lock-step. docs/ros.md describes their topics and parameters."""

    bridge: ClassVar[str] = "ros1"
    topics: Annotated[Mapping[str, str], TOPICS] = field(default_factory=EXPECTED.copy)
