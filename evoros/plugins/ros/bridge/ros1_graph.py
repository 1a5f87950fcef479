"""The ROS 1 graph of a mission: master, connections and messages."""

from __future__ import annotations

import io
import select
import socket
import struct
import sys
import warnings
from collections.abc import Iterator
from typing import Any
from xmlrpc.client import Error, ServerProxy

import genpy
import roslib.message
import rospy
from rosgraph.masterapi import Master, MasterException
from rosgraph.network import read_ros_handshake_header, write_ros_handshake_header

from .conversation import Tick, check_publisher
from .lockstep import Nodes
from .messages import Messages

NAME = "/evoros"  # name of this process in the graph
HEADER_BYTES = 4096


def join() -> None:
    """Make this process a node that uses wall-clock time."""
    rospy.init_node(
        NAME[1:], argv=[], disable_rostime=True, disable_rosout=True, disable_signals=True
    )


def ask_node(address: str, method: str, *arguments: Any) -> Any:
    """Call a method of a node; raise an OSError if the node has gone or refuses."""
    answer: Any = getattr(ServerProxy(address), method)(NAME, *arguments)
    status, why, value = answer
    if status != 1:
        raise OSError(f"{method} of a node: {why}")
    return value


class Incoming:
    """The messages of one publisher, fetched without a thread."""

    def __init__(self, topic: str, publisher: str, kind: str) -> None:
        """Connect to the node of the publisher; raise a ValueError for an unknown message type."""
        self._topic = topic
        self._class: Any = roslib.message.get_message_class(kind)
        if self._class is None:
            raise ValueError(f"{topic}: {sys.executable} cannot import {kind}; install its package")
        _, host, port = ask_node(publisher, "requestTopic", topic, [["TCPROS"]])
        self._socket = socket.create_connection((host, port))
        header = {"topic": topic, "type": kind, "md5sum": self._class._md5sum, "callerid": NAME}
        write_ros_handshake_header(self._socket, {**header, "tcp_nodelay": "1"})
        buffer = io.BytesIO()
        read_ros_handshake_header(self._socket, buffer, HEADER_BYTES)
        self._received = buffer.getvalue()
        self._socket.setblocking(False)

    def wait(self, limit_s: float) -> bool:
        """Return True if data arrives within a wall-clock time [s]."""
        return bool(select.select([self._socket], [], [], limit_s)[0])

    def fetch(self) -> list[Any]:
        """Return the messages received so far; raise a ConnectionError if the node has gone."""
        messages = []
        self._receive()
        while len(self._received) >= 4:
            (size,) = struct.unpack_from("<I", self._received)
            if len(self._received) < 4 + size:
                break
            message = self._class()
            message.deserialize(self._received[4 : 4 + size])
            messages.append(message)
            self._received = self._received[4 + size :]
        return messages

    def _receive(self) -> None:
        while True:
            try:
                data = self._socket.recv(1 << 16)
            except BlockingIOError:
                return
            if not data:
                raise ConnectionError(f"a node no longer publishes on {self._topic}")
            self._received += data


class Outgoing:
    """The publishers of this process and their messages."""

    def __init__(self, briefing: dict[str, Any]) -> None:
        self._messages = Messages(briefing, genpy.Time)
        topics = briefing["ros"]["topics"]
        latched = {topics["goal"], topics["route"]}
        # A publisher without the queue that rospy recommends sends immediately.
        warnings.filterwarnings("ignore", "The publisher should be created", SyntaxWarning)
        self.publishers = {
            topic: rospy.Publisher(
                topic, kind, queue_size=None, tcp_nodelay=True, latch=topic in latched
            )
            for topic, kind in self._messages.kinds().items()
        }
        topic, route = self._messages.route()
        self.publishers[topic].publish(route)

    def messages(self, tick: Tick) -> Iterator[tuple[Any, Any]]:
        """Yield (publisher, message) in the order in which nodes receive them."""
        for together in self._messages.of(tick):
            for topic, message in together:
                yield self.publishers[topic], message


class Graph:
    """The nodes of a mission, and the connections between them."""

    def __init__(self, nodes: Nodes, publishers: list[Any]) -> None:
        """Create the graph; ``publishers`` belong to this process."""
        self._master, self._nodes, self._publishers = Master(NAME), nodes, publishers
        self._places: dict[str, int | None] = {}  # index of each node's command, by node address
        self._addresses: dict[str, str] = {}  # node address by name
        self._published: dict[str, list[str]] = {}
        self._subscribed: dict[str, list[str]] = {}

    def missing(self, command_topic: str) -> str | None:
        """Describe what the mission lacks before it can start; None if nothing."""
        try:
            self._update()
            return self._missing_node(command_topic) or self._missing_connection()
        except (OSError, Error, MasterException) as error:  # a node is starting or exiting
            return f"a node does not answer: {error}"

    def publisher(self, topic: str, kinds: tuple[str, ...]) -> tuple[str, str] | None:
        """Return the address and message type of a topic's publisher; see ``check_publisher``."""
        names = self._published.get(topic, [])
        if not names:
            return None
        kind = str(dict(self._master.getTopicTypes())[topic])
        check_publisher(topic, names, kind, kinds)
        return self._addresses[names[0]], kind

    def place(self, connection: Any) -> tuple[int, str]:
        """Return a sort key: the index of the command that started the node, then its name."""
        name = connection.endpoint_id
        place = self._places.get(self._addresses.get(name, ""))
        return (-1 if place is None else place), name

    def _update(self) -> None:
        published, subscribed, _ = self._master.getSystemState()
        self._published, self._subscribed = (
            {topic: sorted(name for name in names if name != NAME) for topic, names in topics}
            for topics in (published, subscribed)
        )
        names = {
            name
            for topics in (self._published, self._subscribed)
            for group in topics.values()
            for name in group
        }
        self._addresses = {name: self._master.lookupNode(name) for name in sorted(names)}
        for address in self._addresses.values():
            if address not in self._places:
                self._places[address] = self._nodes.place(int(ask_node(address, "getPid")))

    def _missing_node(self, command_topic: str) -> str | None:
        others = self._nodes.others(set(self._places.values()))
        if others:
            return f"{others[0]} has started no node"
        if not self._published.get(command_topic):
            return f"no node publishes on {command_topic}"
        # every node subscribes to the clock
        topics = {publisher.resolved_name for publisher in self._publishers} - {"/clock"}
        if not any(self._subscribed.get(topic) for topic in topics):
            return f"no node subscribes to {', '.join(sorted(topics))}"
        return None

    def _missing_connection(self) -> str | None:
        for publisher in self._publishers:
            topic = publisher.resolved_name
            if publisher.get_num_connections() != len(self._subscribed.get(topic, [])):
                return f"a node is not yet connected to {topic}"
        # also between nodes, because earlier messages would be lost
        connected = self._connections()
        for topic, names in self._subscribed.items():
            for name in names:
                if connected.get((name, topic), 0) < len(self._published.get(topic, [])):
                    return f"{name} is not yet connected to all publishers of {topic}"
        return None

    def _connections(self) -> dict[tuple[str, str], int]:
        count: dict[tuple[str, str], int] = {}
        for name in {name for names in self._subscribed.values() for name in names}:
            connections = ask_node(self._addresses[name], "getBusInfo")
            for _, _, direction, _, topic, *connected in connections:
                if direction == "i" and (not connected or connected[0]):
                    count[name, topic] = count.get((name, topic), 0) + 1
        return count
