"""The bridge to ROS 1: starts the user's nodes and flies one mission with them, in lock-step.

The user's own ROS Python runs this script. It needs the standard library, and rospy with its
messages. docs/ros.md describes the topics, the parameters and the lock-step.
"""

from __future__ import annotations

import logging
import os
import time
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from evoros.bridge.ros import ros1_graph, ros1_messages
    from evoros.bridge.ros.conversation import (
        COMMANDS,
        OWN_SHARE,
        PAUSE_S,
        STEADY,
        Conversation,
        Modes,
        Wheels,
        end,
    )
    from evoros.bridge.ros.nodes import Nodes
    from evoros.bridge.ros.rest import Hidden, Rest
    from evoros.bridge.ros.ros1_master import set_parameters, start_master
else:
    from conversation import COMMANDS, OWN_SHARE, PAUSE_S, STEADY, Conversation, Modes, Wheels, end
    from nodes import Nodes
    from rest import Hidden, Rest
    from ros1_master import set_parameters, start_master

NEEDED = ("rospy", "rosmaster", "geometry_msgs", "nav_msgs", "sensor_msgs", "rosgraph_msgs")


def main() -> None:
    """Fly one mission."""
    conversation = Conversation()
    options = conversation.briefing["ros"]
    until = time.monotonic() + OWN_SHARE * options["start_limit_s"]
    conversation.require("ROS 1", NEEDED, "")
    try:
        rest = Rest(options["isolate"])
    except OSError as error:
        conversation.refuse(f"the system must show what threads wait for ({error})")
    try:
        mission = Mission(conversation, rest, start_nodes(conversation, until))
        mission.connect(until)
        conversation.ready()
        mission.fly()
    except Hidden as error:
        conversation.fail(f"controller.nodes: {error}")
    os._exit(0)  # whatever the threads of rospy do


def start_nodes(conversation: Conversation, until: float) -> Nodes:
    """Start the master and the user's nodes."""
    options = conversation.briefing["ros"]
    try:
        environment = start_master(options["isolate"], until)
    except TimeoutError as error:
        end(str(error))
    os.environ.update(environment)
    try:
        set_parameters(environment["ROS_MASTER_URI"], conversation.briefing)
        return Nodes(options["nodes"], environment)
    except ValueError as error:
        conversation.refuse(str(error))
    except OSError as error:
        conversation.refuse(
            f"controller.nodes: must be commands that this system can execute, not "
            f"{error.filename} ({error.strerror}); correct it"
        )


class Mission:
    """One mission with nodes of ROS 1."""

    def __init__(self, conversation: Conversation, rest: Rest, nodes: Nodes) -> None:
        """Join the graph. The imports take a while, as those of the nodes do."""
        logging.disable(logging.CRITICAL)
        self._module, messages = import_module("ros1_graph"), import_module("ros1_messages")
        self._module.join()
        briefing = conversation.briefing
        self._conversation, self._rest, self._nodes = conversation, rest, nodes
        self._options: dict[str, Any] = briefing["ros"]
        self._wheels = Wheels(briefing["drive"], self._options["twist"])
        self._modes = Modes(briefing["modes"])
        self._outgoing: ros1_messages.Outgoing = messages.Outgoing(briefing)
        self._graph: ros1_graph.Graph = self._module.Graph(nodes, self._outgoing.publishers())
        topics: dict[str, str] = self._options["topics"]
        self._command, self._mode = topics["command"], topics["mode"]
        self._incoming: dict[str, ros1_graph.Incoming] = {}  # by topic

    def connect(self, until: float) -> None:
        """Return when every connection stands and all are at rest.

        What nodes have said until then has not been said in the mission.
        """
        while not self._steady():
            if time.monotonic() > until:
                self._conversation.refuse(
                    f"controller.nodes: {self._missing() or self._unrest()}, after "
                    f"{self._options['start_limit_s']:g} s; correct the nodes or start_limit_s"
                )
            time.sleep(PAUSE_S)
        self._rest.prepare()
        self._require_rest(until + PAUSE_S)  # after the last questions to the nodes
        self._hear()

    def _steady(self) -> bool:
        """Whether nothing is missing, before and after all have been at rest for a while."""
        if self._missing() is not None:
            return False
        for _ in range(STEADY):
            if not self._rest.wait(1.0):
                return False
            time.sleep(PAUSE_S)
        return self._missing() is None

    def _missing(self) -> str | None:
        """Connect with the nodes that publish commands and modes; return what is missing."""
        self._require_nodes()
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
        """Answer each tick by what the nodes command."""
        for tick in self._conversation.ticks():
            until = time.monotonic() + OWN_SHARE * self._options["answer_limit_s"]
            self._require_nodes()
            for publisher, message in self._outgoing.messages(tick):
                connections = sorted(publisher.impl.connections, key=self._graph.place)
                for connection in connections:  # one node after the other
                    publisher.impl.publish(message, connection_override=connection)
                    self._require_rest(until)
            # Nodes that answer poses cannot while the localization is silent.
            if self._options["answer"] == "each" and tick.state[0] is not None:
                self._require_command(until)
            self._answer()

    def _answer(self) -> None:
        commands = self._hear()
        if not commands:
            self._conversation.answer(0, 0.0, 0.0)
            return
        for message in commands:
            speed, steering = self._wheels.read(message)
        self._conversation.answer(self._modes.now, speed, steering)

    def _hear(self) -> list[Any]:
        """Return the commands that have arrived, and note the mode."""
        try:
            if self._mode in self._incoming:
                for message in self._incoming[self._mode].fetch():
                    self._modes.report(message.data)
            return self._incoming[self._command].fetch()
        except ConnectionError as error:
            time.sleep(10 * PAUSE_S)  # perhaps its process is about to end
            self._require_nodes()
            end(str(error))

    def _require_nodes(self) -> None:
        ended = self._nodes.ended()
        if ended is not None:
            end(ended)

    def _require_rest(self, until: float) -> None:
        if not self._rest.wait(until - time.monotonic()):
            end(self._unrest())

    def _unrest(self) -> str:
        return f"the nodes did not come to rest: {'; '.join(self._rest.working())}"

    def _require_command(self, until: float) -> None:
        """Wait for a command, and for rest after it."""
        while not self._incoming[self._command].wait(PAUSE_S):
            self._require_nodes()
            if time.monotonic() > until:
                end("no node commanded; answer=each needs a command at each tick, answer=rest none")
        self._require_rest(until)


if __name__ == "__main__":
    main()
