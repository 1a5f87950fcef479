"""The base of the controllers that are nodes of ROS: which nodes, on which topics."""

import shlex
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Annotated, ClassVar

from evoros.base.checks import TEXT, Rule, checked, one_of
from evoros.controller.line_controller import COMMAND, LineController, list_files, split_command
from evoros.controller.protocol import Briefing, Pilot
from evoros.files.resources import PACKAGE

BRIDGES = PACKAGE / "bridge" / "ros"
SENSOR = "{sensor}"
ROLES = ("command", "goal", "mode", "odometry", "range", "route")

NODES = Rule(
    "a list of commands, at least one, each a text or a list of texts",
    lambda v: isinstance(v, list | tuple) and bool(v) and all(map(COMMAND.holds, v)),
)
TOPICS = Rule(
    f"texts that begin with / for {', '.join(ROLES)}, with {SENSOR} in the text of range",
    lambda v: (
        isinstance(v, Mapping)
        and sorted(v) == list(ROLES)
        and all(isinstance(topic, str) and topic.startswith("/") for topic in v.values())
        and SENSOR in v["range"]
    ),
)


def name_topics(goal: str) -> dict[str, str]:
    """Return the topics on which nodes usually expect the roles."""
    return {
        "command": "/cmd_vel",
        "goal": goal,
        "mode": "/mode",
        "odometry": "/odom",
        "range": f"/{SENSOR}",
        "route": "/route",
    }


@dataclass(frozen=True, kw_only=True)
@checked
class RosController(LineController):
    """Starts nodes of ROS for each mission, and a bridge between them and the mission.

    The bridge is a script that runs in ``python``, the one that has ROS.
    """

    bridge: ClassVar[str]  # the name of its script
    python: Annotated[str, TEXT] = "/usr/bin/python3"
    nodes: Annotated[Sequence[str | Sequence[str]], NODES]
    topics: Annotated[Mapping[str, str], TOPICS]
    frame: Annotated[str, TEXT] = "odom"  # the world's
    twist: Annotated[str, one_of("yaw_rate", "steering")] = "yaw_rate"  # what angular.z is
    answer: Annotated[str, one_of("rest", "each")] = "rest"

    def __post_init__(self) -> None:
        nodes = [_split_node(node) for node in self.nodes]
        files = [file for node in nodes for file in list_files(node, self.files)]
        object.__setattr__(self, "nodes", nodes)
        object.__setattr__(self, "files", tuple(dict.fromkeys(files)))

    def launch(self, briefing: Briefing) -> AbstractContextManager[Pilot]:
        """Start the bridge and the nodes for one mission.

        Raises:
            LaunchError: the bridge cannot be started, or refuses the briefing.
            PilotLost: the nodes were not ready in time.
        """
        options = {
            "nodes": self.nodes,
            "topics": dict(self.topics),
            "frame": self.frame,
            "twist": self.twist,
            "answer": self.answer,
            "isolate": self.isolate,
            "start_limit_s": self.start_limit_s,
            "answer_limit_s": self.answer_limit_s,
            "description": _describe_robot(briefing),
        }
        command = [*split_command([self.python]), str(BRIDGES), self.bridge]
        return self.fly(command, briefing, {"ros": options})


def _split_node(command: str | Sequence[str]) -> list[str]:
    """Return the words of a command; ``python3`` stays, so that it becomes ROS's Python."""
    program = (shlex.split(command) if isinstance(command, str) else command)[0]
    words = split_command(command)
    return words if "/" in program else [program, *words[1:]]


def _describe_robot(briefing: Briefing) -> str:
    """Return a URDF whose root link is the frame of the robot's poses."""
    robot = briefing.robot
    return robot.urdf if robot.engine_urdf is None else robot.loaded_urdf
