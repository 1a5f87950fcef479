"""The ROS 2 graph of a mission: messages, and publishers for each group of nodes."""

from __future__ import annotations

import importlib
import shlex
import sys
from collections.abc import Callable, Collection, Mapping
from typing import Any

import rclpy
from builtin_interfaces.msg import Time
from rcl_interfaces.srv import GetParameters
from rclpy.qos import DurabilityPolicy, QoSProfile

from .conversation import check_publisher
from .messages import CLOCK, TRANSFORMS
from .ros2_start import Group

NAME = "evoros"  # name of this process in the graph
SPIN_S = 0.02
DEPTH = 100  # maximum number of commands queued per tick
UNKNOWN = "_NODE_NAME_UNKNOWN_"  # name assigned by rmw_dds_common
EACH = QoSProfile(depth=10)  # reliable and volatile; also matches best-effort subscriptions
KEPT = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""QoS profile of the goal and the route, which are rarely published."""


def stamp(seconds: int, nanoseconds: int) -> Any:
    """Return a ROS time for messages."""
    return Time(sec=seconds, nanosec=nanoseconds)


class Outlet:
    """The publishers for one group of nodes, by topic."""

    def __init__(
        self, node: Any, group: Group, kinds: Mapping[str, type], kept: Collection[str]
    ) -> None:
        self._node, self._commands = node, group.commands
        self._publishers = {
            topic: node.create_publisher(
                kind, group.prefix + topic, KEPT if topic in kept else EACH
            )
            for topic, kind in kinds.items()
        }
        self._order: dict[str, bytes] = {}
        self._one_by_one = True

    def arrange(self) -> None:
        """Find the order of the node's subscriptions, once the node is connected.

        An executor runs ready callbacks in this order, regardless of the order of arrival. Nodes
        may differ in the order, so each message is delivered while they are at rest.
        """
        infos = {
            topic: self._node.get_subscriptions_info_by_topic(publisher.topic_name)
            for topic, publisher in self._publishers.items()
        }
        self._one_by_one = any(len(subscriptions) > 1 for subscriptions in infos.values())
        # bytes 12 to 15 of the identifier number the subscription within a node
        self._order = {
            topic: bytes(subscription.endpoint_gid[12:16])
            for topic, subscriptions in infos.items()
            for subscription in subscriptions
        }

    def deliver(self, together: list[tuple[str, Any]], require_rest: Callable[[], None]) -> None:
        """Publish a group of messages, and wait until the nodes are at rest."""
        heard = [(topic, message) for topic, message in together if self.hears(topic)]
        for topic, message in sorted(heard, key=lambda item: self._order.get(item[0], b"")):
            self._publishers[topic].publish(message)
            if self._one_by_one:
                require_rest()
        if heard and not self._one_by_one:
            require_rest()

    def hears(self, topic: str) -> bool:
        """Return True if a node of the group subscribes to a topic."""
        publisher = self._publishers.get(topic)
        return publisher is not None and publisher.get_subscription_count() > 0

    def names(self) -> list[str]:
        """Return the topic names used by the nodes of the group."""
        return [publisher.topic_name for publisher in self._publishers.values()]

    def missing(self) -> str | None:
        """Describe a connection or node that the group still lacks; None if complete."""
        if self._commands and self._listening(CLOCK) < len(self._commands):
            names = " or ".join(shlex.join(command) for command in self._commands)
            return (
                f"{names} has started no node that follows simulated time (the nodes need the "
                f"parameter file of evoros, which is passed to a launch file as {{parameters}})"
            )
        for topic, publisher in self._publishers.items():
            if publisher.get_subscription_count() != self._listening(topic):
                return f"a node does not connect to {topic} (its QoS must be reliable and volatile)"
        return None

    def _listening(self, topic: str) -> int:
        return int(self._node.count_subscribers(self._publishers[topic].topic_name))


class Incoming:
    """The messages of one publisher, fetched without a thread."""

    def __init__(self, node: Any, topic: str, publisher: Any) -> None:
        """Subscribe with the publisher's reliability; raise a ValueError for an unknown type."""
        kind = publisher.topic_type
        package, _, name = kind.replace("/msg/", "/").partition("/")
        try:
            self._class = getattr(importlib.import_module(f"{package}.msg"), name)
        except (ImportError, AttributeError):
            why = f"{topic}: {sys.executable} cannot import {kind}; install its package"
            raise ValueError(why) from None
        quality = QoSProfile(depth=DEPTH, reliability=publisher.qos_profile.reliability)
        # the callback discards messages from before the mission
        self._subscription = node.create_subscription(
            self._class, topic, lambda message: None, quality
        )

    def connected(self) -> bool:
        """Return True if the publisher is matched; always True on Humble, which cannot tell."""
        count = getattr(self._subscription, "get_publisher_count", None)
        return count is None or count() > 0

    def fetch(self) -> list[Any]:
        """Return the messages received so far; an executor would take 100 times as long."""
        messages, handle = [], self._subscription.handle
        with handle:
            while (taken := handle.take_message(self._class, False)) is not None:
                messages.append(taken[0])
        return messages


class Graph:
    """The nodes of a mission, and the connections between them."""

    def __init__(
        self, groups: list[Group], kinds: Mapping[str, type], kept: Collection[str]
    ) -> None:
        """Create publishers of ``kinds`` (types by topic); ``kept`` topics retain one message."""
        rclpy.init(args=[])
        self._node = rclpy.create_node(
            NAME, use_global_arguments=False, enable_rosout=False, start_parameter_services=False
        )
        self._clients: dict[str, Any] = {}  # one per node
        self._answers: dict[str, Any] = {}
        self._topics = sorted(kinds.keys() - {CLOCK})  # every node subscribes to the clock
        # nodes also exchange transforms among themselves, so this topic has no prefix
        shared = {topic: kind for topic, kind in kinds.items() if topic == TRANSFORMS}
        others = {topic: kind for topic, kind in kinds.items() if topic != TRANSFORMS}
        self.outlets = [Outlet(self._node, Group("", []), shared, kept)]
        self.outlets += [Outlet(self._node, group, others, kept) for group in groups]

    def missing(self, command_topic: str) -> str | None:
        """Describe what the mission lacks before it can start; None if nothing."""
        for outlet in self.outlets:
            missing = outlet.missing()
            if missing is not None:
                return missing
        if not self._node.count_publishers(command_topic):
            return f"no node publishes on {command_topic}"
        if not any(outlet.hears(topic) for outlet in self.outlets for topic in self._topics):
            return f"no node subscribes to {', '.join(self._topics)}"
        return None

    def unanswered(self) -> str | None:
        """Ask each node for a parameter; describe a node that has not answered, if any.

        Only an answer proves that a node knows its connections, because nodes learn of connections
        in the order of their creation, and the client that asks is created last.
        """
        for name, namespace in sorted(self._listeners()):
            if name == UNKNOWN:
                return "the name of a node is not yet known"
            place = f"{namespace.rstrip('/')}/{name}"
            services = self._node.get_service_names_and_types_by_node(name, namespace)
            asked = f"{place}/get_parameters" in dict(services)
            if asked and not self._has_answered(place):
                return f"the node {place} does not answer (it must spin)"
        return None

    def _listeners(self) -> set[tuple[str, str]]:
        """Return the name and namespace of each node that subscribes to this process's topics."""
        topics = [topic for outlet in self.outlets for topic in outlet.names()]
        listening = [self._node.get_subscriptions_info_by_topic(topic) for topic in topics]
        return {(node.node_name, node.node_namespace) for nodes in listening for node in nodes}

    def _has_answered(self, place: str) -> bool:
        if place not in self._clients:
            service = f"{place}/get_parameters"
            self._clients[place] = self._node.create_client(GetParameters, service)
        client = self._clients[place]
        if place not in self._answers and client.service_is_ready():
            request = GetParameters.Request(names=["use_sim_time"])
            self._answers[place] = client.call_async(request)
        rclpy.spin_once(self._node, timeout_sec=SPIN_S)
        return place in self._answers and bool(self._answers[place].done())

    def receive(
        self, topic: str, kinds: tuple[str, ...], connected: Incoming | None
    ) -> Incoming | None:
        """Return a connection to a topic's publisher; ``connected`` is the existing one, if any."""
        publishers = self._node.get_publishers_info_by_topic(topic)
        names = sorted(publisher.node_name for publisher in publishers)
        if not publishers or UNKNOWN in names:
            return connected
        check_publisher(topic, names, publishers[0].topic_type, kinds)
        return connected or Incoming(self._node, topic, publishers[0])
