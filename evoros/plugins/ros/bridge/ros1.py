"""The bridge to ROS 1, in the user's ROS Python; rospy is imported after the nodes have started."""

from __future__ import annotations

import logging
import os
import socket
import subprocess
import sys
import time
from importlib import import_module
from typing import TYPE_CHECKING, Any
from xmlrpc.client import Fault, ServerProxy

from .conversation import COMMANDS, OWN_SHARE, PAUSE_S, STEADY, Conversation, end
from .lockstep import NO_COMMAND, Crew, Nodes, fly_mission
from .rest import Rest

if TYPE_CHECKING:
    from . import ros1_graph

PORT = 11311  # default port of the master
_LARGEST_SEED = 2**31  # parameters are signed 32-bit integers
TOLD = ("sensors", "drive", "home", "route", "acceptance_m", "time_limit_s", "period_s")
PROGRAM = """
import sys, time
from rosmaster.master import Master
master = Master(int(sys.argv[1]), num_workers=1)
master.start()
while master.ok():
    time.sleep(0.5)
"""
NEEDED = ("rospy", "rosmaster", "geometry_msgs", "nav_msgs", "sensor_msgs", "rosgraph_msgs")


def start_nodes(briefing: dict[str, Any], until: float) -> Nodes:
    """Start the master and the user's nodes; raise OSError or ValueError to reject the mission."""
    options = briefing["ros"]
    try:
        environment = _start_master(options["isolate"], until)
    except TimeoutError as error:
        end(str(error))
    os.environ.update(environment)
    _set_parameters(environment["ROS_MASTER_URI"], briefing)
    return Nodes(options["nodes"], environment)


class Mission:
    """One mission with ROS 1 nodes."""

    def __init__(self, conversation: Conversation, rest: Rest, until: float) -> None:
        """Start the nodes and join the graph; import rospy while the nodes start."""
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
        self._incoming: dict[str, ros1_graph.Incoming] = {}

    def connect(self, until: float) -> None:
        """Wait until all nodes are connected and at rest; discard earlier messages."""
        while not self._steady():
            self._crew.require_start(until, self._missing)
            time.sleep(PAUSE_S)
        self._crew.rest.prepare()
        self._crew.require_rest(until + PAUSE_S)  # lets the nodes answer the last requests
        self._hear()

    def _steady(self) -> bool:
        """Return True if nothing is missing before and after a period of rest."""
        if self._missing() is not None:
            return False
        for _ in range(STEADY):
            if not self._crew.rest.wait(1.0):
                return False
            time.sleep(PAUSE_S)
        return self._missing() is None

    def _missing(self) -> str | None:
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
        """Answer each tick with the commands of the nodes."""
        for tick in self._conversation.ticks():
            until = time.monotonic() + OWN_SHARE * self._crew.options["answer_limit_s"]
            self._crew.require_nodes()
            for publisher, message in self._outgoing.messages(tick):
                connections = sorted(publisher.impl.connections, key=self._graph.place)
                for connection in connections:  # so that nodes receive it one after another
                    publisher.impl.publish(message, connection_override=connection)
                    self._crew.require_rest(until)
            # Nodes that react to poses stay silent while the localization is silent.
            if self._crew.options["answer"] == "each" and tick.state[0] is not None:
                self._require_command(until)
            self._crew.answer(self._hear())

    def _hear(self) -> list[Any]:
        try:
            if self._mode in self._incoming:
                for message in self._incoming[self._mode].fetch():
                    self._crew.modes.report(message.data)
            return self._incoming[self._command].fetch()
        except ConnectionError as error:
            time.sleep(10 * PAUSE_S)  # the node may be about to exit
            self._crew.require_nodes()
            end(str(error))

    def _require_command(self, until: float) -> None:
        while not self._incoming[self._command].wait(PAUSE_S):
            self._crew.require_nodes()
            if time.monotonic() > until:
                end(NO_COMMAND)
        self._crew.require_rest(until)


def main() -> None:
    """Run one mission."""
    fly_mission("ROS 1", NEEDED, "", Mission)


def _start_master(isolated: bool, until: float) -> dict[str, str]:
    """Start a master in another process; return the environment through which nodes find it."""
    port = PORT if isolated else _free_port()
    folder = os.getcwd()
    environment = {name: value for name, value in os.environ.items() if name != "ROS_HOSTNAME"}
    environment["ROS_MASTER_URI"] = f"http://127.0.0.1:{port}"
    environment.update(ROS_IP="127.0.0.1", ROS_HOME=folder, ROS_LOG_DIR=folder)
    process = subprocess.Popen([sys.executable, "-c", PROGRAM, str(port)], env=environment)
    while process.poll() is None and time.monotonic() < until:
        try:
            socket.create_connection(("127.0.0.1", port)).close()
            return environment
        except ConnectionRefusedError:
            time.sleep(0.005)
    raise TimeoutError("the ROS master did not start")


def _free_port() -> int:
    with socket.socket() as any_socket:
        any_socket.bind(("127.0.0.1", 0))
        return int(any_socket.getsockname()[1])


def _set_parameters(address: str, briefing: dict[str, Any]) -> None:
    master = ServerProxy(address)
    for name, value in _parameters(briefing).items():
        try:
            master.setParam("/evoros", name, value)
        except (TypeError, OverflowError, Fault) as error:
            raise ValueError(
                f"controller.parameters.{name[1:]}: must be a number, a string, true or false, or "
                f"lists and mappings of these ({error}); change the value"
            ) from None


def _parameters(briefing: dict[str, Any]) -> dict[str, Any]:
    return {
        **{f"/{name}": value for name, value in briefing["parameters"].items()},
        "/use_sim_time": True,
        "/robot_description": briefing["ros"]["description"],
        "/evoros": {
            **{name: briefing[name] for name in TOLD},
            "seed": briefing["seed"] % _LARGEST_SEED,
        },
    }
