"""Controllers that run the user's ROS 1 or ROS 2 nodes in lock-step."""

import shlex
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Annotated, ClassVar

from evoros.base.checks import TEXT, Rule, checked, one_of
from evoros.controller.line_controller import COMMAND, LineController, list_files, split_command
from evoros.controller.protocol import Briefing, Pilot

BRIDGES = Path(__file__).with_name("bridge")
SENSOR = "{sensor}"
ROLES = ("command", "goal", "mode", "odometry", "range", "route")

NODES = Rule(
    "a non-empty list of commands, each a string or a list of strings",
    lambda v: isinstance(v, list | tuple) and bool(v) and all(map(COMMAND.holds, v)),
)
TOPICS = Rule(
    f"strings that start with / for {', '.join(ROLES)}, with {SENSOR} in range",
    lambda v: (
        isinstance(v, Mapping)
        and sorted(v) == list(ROLES)
        and all(isinstance(topic, str) and topic.startswith("/") for topic in v.values())
        and SENSOR in v["range"]
    ),
)


def name_topics(goal: str) -> dict[str, str]:
    """Return the usual topic for each role."""
    usual = "/cmd_vel", goal, "/mode", "/odom", f"/{SENSOR}", "/route"
    return dict(zip(ROLES, usual, strict=True))


@dataclass(frozen=True, kw_only=True)
@checked
class RosController(LineController):
    """A controller that runs ROS nodes in each mission, and a bridge to them in ``python``."""

    bridge: ClassVar[str]  # name of the bridge script
    python: Annotated[str, TEXT] = "/usr/bin/python3"
    nodes: Annotated[Sequence[str | Sequence[str]], NODES]
    topics: Annotated[Mapping[str, str], TOPICS]
    frame: Annotated[str, TEXT] = "odom"  # name of the world frame
    twist: Annotated[str, one_of("yaw_rate", "steering")] = "yaw_rate"  # meaning of angular.z
    answer: Annotated[str, one_of("rest", "each")] = "rest"

    def __post_init__(self) -> None:
        nodes = [_split_node(node) for node in self.nodes]
        files = [file for node in nodes for file in list_files(node, self.files)]
        object.__setattr__(self, "nodes", nodes)
        object.__setattr__(self, "files", tuple(dict.fromkeys(files)))

    def launch(self, briefing: Briefing) -> AbstractContextManager[Pilot]:
        """Start the bridge and the nodes of a mission."""
        robot = briefing.robot
        kept = ("nodes", "frame", "twist", "answer", "isolate", "start_limit_s", "answer_limit_s")
        options = {
            **{name: getattr(self, name) for name in kept},
            "topics": dict(self.topics),
            # the root link of this URDF is the frame of the robot's poses
            "description": robot.urdf if robot.engine_urdf is None else robot.loaded_urdf,
        }
        command = [*split_command([self.python]), str(BRIDGES), self.bridge]
        return self.fly(command, briefing, {"ros": options})


def _split_node(command: str | Sequence[str]) -> list[str]:
    """Split a command into words; keep a bare program name, which the PATH of ROS resolves."""
    program = (shlex.split(command) if isinstance(command, str) else command)[0]
    words = split_command(command)
    return words if "/" in program else [program, *words[1:]]


@dataclass(frozen=True, kw_only=True)
@checked
class Ros1(RosController):
    """A controller that runs ROS 1 nodes in lock-step; README.md lists topics and parameters."""

    bridge: ClassVar[str] = "ros1"
    topics: Annotated[Mapping[str, str], TOPICS] = field(
        default_factory=partial(name_topics, "/move_base_simple/goal")
    )


@dataclass(frozen=True, kw_only=True)
@checked
class Ros2(RosController):
    """A controller that runs ROS 2 nodes in lock-step; README.md lists topics and parameters."""

    bridge: ClassVar[str] = "ros2"
    topics: Annotated[Mapping[str, str], TOPICS] = field(
        default_factory=partial(name_topics, "/goal_pose")
    )
