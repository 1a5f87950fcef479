"""The bridge to ROS 1: starts the user's nodes and flies one mission with them, in lock-step.

The user's ROS Python runs it. It needs the standard library, and rospy with its messages.
docs/ros.md describes the topics, the parameters and the lock-step.
"""

from __future__ import annotations

import logging
import os
import time
from importlib import import_module
from typing import TYPE_CHECKING, Any

from .conversation import COMMANDS, OWN_SHARE, PAUSE_S, STEADY, Conversation, end
from .lockstep import NO_COMMAND, Crew, fly_mission
from .nodes import Nodes
from .rest import Rest
from .ros1_master import set_parameters, start_master

if TYPE_CHECKING:
    from . import ros1_graph

NEEDED = ("rospy", "rosmaster", "geometry_msgs", "nav_msgs", "sensor_msgs", "rosgraph_msgs")


def start_nodes(briefing: dict[str, Any], until: float) -> Nodes:
    """Start the master and the user's nodes.

    Raises:
        OSError: a command cannot be executed.
        ValueError: a parameter is none of ROS.
    """
    options = briefing["ros"]
    try:
        environment = start_master(options["isolate"], until)
    except TimeoutError as error:
        end(str(error))
    os.environ.update(environment)
    set_parameters(environment["ROS_MASTER_URI"], briefing)
    return Nodes(options["nodes"], environment)


class Mission:
    """One mission with nodes of ROS 1."""

    def __init__(self, conversation: Conversation, rest: Rest, until: float) -> None:
        """Start the nodes and join the graph. The imports take a while, as in nodes."""
        briefing = conversation.briefing
        self._crew = Crew(conversation, rest, lambda: start_nodes(briefing, until))
        logging.disable(logging.CRITICAL)
        self._module = import_module(".ros1_graph", __package__)
        self._module.join()
        self._conversation = conversation
        self._outgoing: ros1_graph.Outgoing = self._module.Outgoing(briefing)
        publishers = list(self._outgoing.publishers.values())
        self._graph: ros1_graph.Graph = self._module.Graph(self._crew.nodes, publishers)
        topics: dict[str, str] = self._crew.options["topics"]
        self._command, self._mode = topics["command"], topics["mode"]
        self._incoming: dict[str, ros1_graph.Incoming] = {}  # by topic

    def connect(self, until: float) -> None:
        """Return when every connection stands and all are at rest; forget earlier messages."""
        while not self._steady():
            self._crew.require_start(until, self._missing)
            time.sleep(PAUSE_S)
        self._crew.rest.prepare()
        self._crew.require_rest(until + PAUSE_S)  # after the last questions to the nodes
        self._hear()

    def _steady(self) -> bool:
        """Whether nothing is missing, before and after all have been at rest for a while."""
        if self._missing() is not None:
            return False
        for _ in range(STEADY):
            if not self._crew.rest.wait(1.0):
                return False
            time.sleep(PAUSE_S)
        return self._missing() is None

    def _missing(self) -> str | None:
        """Connect with the nodes that publish commands and modes; name a lacking connection."""
        self._crew.require_nodes()
        missing = self._graph.missing(self._command)
        if missing is not None:
            return missing
        try:
            for topic, kinds in ((self._command, tuple(COMMANDS)), (self._mode, ("String",))):
                publisher = self._graph.publisher(topic, kinds)
                if publisher is not None and topic not in self._incoming:
                    self._incoming[topic] = self._module.Incoming(topic, *publisher)
        except ValueError as error:
            self._conversation.refuse(str(error))
        except OSError as error:
            return f"a node does not accept a connection ({error})"
        return None

    def fly(self) -> None:
        """Answer each tick by the nodes' commands."""
        for tick in self._conversation.ticks():
            until = time.monotonic() + OWN_SHARE * self._crew.options["answer_limit_s"]
            self._crew.require_nodes()
            for publisher, message in self._outgoing.messages(tick):
                connections = sorted(publisher.impl.connections, key=self._graph.place)
                for connection in connections:  # one node after the other
                    publisher.impl.publish(message, connection_override=connection)
                    self._crew.require_rest(until)
            # Nodes that answer poses cannot while the localization is silent.
            if self._crew.options["answer"] == "each" and tick.state[0] is not None:
                self._require_command(until)
            self._crew.answer(self._hear())

    def _hear(self) -> list[Any]:
        """Return the commands that have arrived, and note the mode."""
        try:
            if self._mode in self._incoming:
                for message in self._incoming[self._mode].fetch():
                    self._crew.modes.report(message.data)
            return self._incoming[self._command].fetch()
        except ConnectionError as error:
            time.sleep(10 * PAUSE_S)  # perhaps its process is about to end
            self._crew.require_nodes()
            end(str(error))

    def _require_command(self, until: float) -> None:
        """Wait for a command, and for rest after it."""
        while not self._incoming[self._command].wait(PAUSE_S):
            self._crew.require_nodes()
            if time.monotonic() > until:
                end(NO_COMMAND)
        self._crew.require_rest(until)


def main() -> None:
    """Fly one mission."""
    fly_mission("ROS 1", NEEDED, "", Mission)
