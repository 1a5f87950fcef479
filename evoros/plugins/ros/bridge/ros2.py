"""The bridge to ROS 2, in the user's ROS Python; it requires only rclpy and messages."""

from __future__ import annotations

import os
import time
from importlib import import_module
from typing import TYPE_CHECKING, Any

from . import ros2_start as launch
from .conversation import COMMANDS, OWN_SHARE, PAUSE_S, STEADY, Conversation, end
from .lockstep import NO_COMMAND, Crew, Nodes, fly_mission
from .rest import Rest

if TYPE_CHECKING:
    from . import ros2_graph
    from .messages import Messages

NEEDED = ("rclpy", "geometry_msgs", "nav_msgs", "sensor_msgs", "rosgraph_msgs")
ADVICE = ", and source /opt/ros/DISTRIBUTION/setup.bash before running evoros"
GRAPH_PAUSE_S, LOOK_S = 0.05, 0.0002
"""Pauses [s] between checks; ``STEADY`` of the first are longer than Fast DDS's resend interval."""


def start_nodes(briefing: dict[str, Any]) -> Nodes:
    """Start the user's nodes; raise OSError or ValueError to reject the mission."""
    commands = briefing["ros"]["nodes"]
    launch.write_parameters(briefing)
    completed = launch.complete(commands, launch.topic_names(briefing))
    return Nodes(commands, dict(os.environ), completed)


class Mission:
    """One mission with ROS 2 nodes."""

    def __init__(self, conversation: Conversation, rest: Rest, until: float) -> None:
        """Start the nodes and join the graph; import rclpy while the nodes start."""
        self._conversation, briefing = conversation, conversation.briefing
        try:
            # the claim is kept until this process exits
            self._claim = launch.set_environment(briefing["ros"]["isolate"])
        except OSError as error:
            conversation.refuse(f"controller: this system cannot run ROS 2 missions ({error})")
        self._crew = Crew(conversation, rest, lambda: start_nodes(briefing))
        self._options = self._crew.options
        graph = import_module(".ros2_graph", __package__)
        messages = import_module(".messages", __package__)
        self._messages: Messages = messages.Messages(briefing, graph.stamp)
        topics = self._options["topics"]
        groups, kept = launch.group(self._options["nodes"]), (topics["goal"], topics["route"])
        self._graph: ros2_graph.Graph = graph.Graph(groups, self._messages.kinds(), kept)
        self._commands: ros2_graph.Incoming | None = None
        self._reports: ros2_graph.Incoming | None = None  # mode reports

    def connect(self, until: float) -> None:
        """Wait until all nodes are connected and at rest; discard earlier messages."""
        while self._missing() is not None or not self._steady():
            self._crew.require_start(until, self._missing)
            time.sleep(PAUSE_S)
            self._crew.require_nodes()
        for outlet in self._graph.outlets:
            outlet.arrange()
        self._crew.rest.prepare()
        self._hear()

    def _missing(self) -> str | None:
        """Connect to publishers of commands and modes; describe a missing connection."""
        topics = self._options["topics"]
        missing = self._graph.missing(topics["command"])
        if missing is not None:
            return missing
        try:
            self._commands = self._graph.receive(topics["command"], tuple(COMMANDS), self._commands)
            self._reports = self._graph.receive(topics["mode"], ("String",), self._reports)
        except ValueError as error:
            self._conversation.refuse(str(error))
        incoming = [item for item in (self._commands, self._reports) if item is not None]
        if self._commands is None or not all(item.connected() for item in incoming):
            return "a node that publishes to evoros is not yet connected"
        return self._graph.unanswered()

    def _steady(self) -> bool:
        first, *others = self._options["nodes"]
        alone = not others and launch.takes_arguments(first)
        for _ in range(STEADY):
            if not self._crew.rest.wait(1.0):
                return False
            time.sleep(PAUSE_S if alone else GRAPH_PAUSE_S)
        return self._crew.rest.wait(1.0) and self._missing() is None

    def fly(self) -> None:
        """Answer each tick with the commands of the nodes."""
        route = [self._messages.route()]
        for tick in self._conversation.ticks():
            until = time.monotonic() + OWN_SHARE * self._options["answer_limit_s"]
            if route:
                self._deliver(route, until)
                route = []
            for together in self._messages.of(tick):
                self._deliver(together, until)
            self._crew.require_nodes()
            commands = self._hear()
            if not commands and self._options["answer"] == "each":
                commands = self._await_command(until)
            self._crew.answer(commands)

    def _deliver(self, together: list[tuple[str, Any]], until: float) -> None:
        """Publish to each group of nodes once the previous group is at rest."""
        for outlet in self._graph.outlets:
            outlet.deliver(together, lambda: self._crew.require_rest(until))

    def _hear(self) -> list[Any]:
        for message in [] if self._reports is None else self._reports.fetch():
            self._crew.modes.report(message.data)
        return [] if self._commands is None else self._commands.fetch()

    def _await_command(self, until: float) -> list[Any]:
        """Wait for a command; return it with others that arrive before the nodes are at rest."""
        commands: list[Any] = []
        while not commands:
            time.sleep(LOOK_S)
            self._crew.require_nodes()
            commands = self._hear()
            if time.monotonic() > until:
                end(NO_COMMAND)
        self._crew.require_rest(until)
        return commands + self._hear()


def main() -> None:
    """Run one mission."""
    fly_mission("ROS 2", NEEDED, ADVICE, Mission)
