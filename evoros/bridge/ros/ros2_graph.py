"""The graph of ROS 2 in a mission: publishers for each group of nodes, and their messages.

Runs in the user's ROS Python.
"""

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

from .messages import CLOCK, TRANSFORMS
from .ros2_start import Group

NAME = "evoros"  # of this process in the graph
SPIN_S = 0.02
DEPTH = 100  # commands of one tick that are kept
UNKNOWN = "_NODE_NAME_UNKNOWN_"  # rmw_dds_common
EACH = QoSProfile(depth=10)  # reliable and volatile, which best-effort subscriptions take too
KEPT = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Qualities of service, the second one for the goal and the route, which are published rarely."""


def stamp(seconds: int, nanoseconds: int) -> Any:
    """Return a time as messages have it."""
    return Time(sec=seconds, nanosec=nanoseconds)


class Outlet:
    """The publishers to one group of nodes, by topic."""

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
        """Learn in which order the node subscribed, once it is connected.

        An executor runs those callbacks that are ready in this order, whichever messages have
        arrived when it looks. Published in this order too, several messages come to the callbacks
        in the same order always. Several nodes, which may have several orders, get each message
        at rest.
        """
        infos = {
            topic: self._node.get_subscriptions_info_by_topic(publisher.topic_name)
            for topic, publisher in self._publishers.items()
        }
        self._one_by_one = any(len(subscriptions) > 1 for subscriptions in infos.values())
        # A node numbers its subscriptions; the number is in the identifier behind the first 12.
        self._order = {
            topic: bytes(subscription.endpoint_gid[12:16])
            for topic, subscriptions in infos.items()
            for subscription in subscriptions
        }

    def deliver(self, together: list[tuple[str, Any]], require_rest: Callable[[], None]) -> None:
        """Publish messages that belong together, and wait until the nodes are at rest."""
        heard = [(topic, message) for topic, message in together if self.hears(topic)]
        for topic, message in sorted(heard, key=self._place):
            self._publishers[topic].publish(message)
            if self._one_by_one:
                require_rest()
        if heard and not self._one_by_one:
            require_rest()

    def _place(self, item: tuple[str, Any]) -> bytes:
        return self._order.get(item[0], b"")

    def hears(self, topic: str) -> bool:
        """Whether a node of the group listens to a topic."""
        publisher = self._publishers.get(topic)
        return publisher is not None and publisher.get_subscription_count() > 0

    def names(self) -> list[str]:
        """Return the topics as the nodes of the group know them."""
        return [publisher.topic_name for publisher in self._publishers.values()]

    def missing(self) -> str | None:
        """Name a thing that is missing until the group is connected; None: nothing."""
        if self._commands and self._listening(CLOCK) < len(self._commands):
            names = " or ".join(shlex.join(command) for command in self._commands)
            return (
                f"{names} has started no node that follows the simulated time, for which it needs "
                f"the parameters of evoros; a launch file takes their file as {{parameters}}"
            )
        for topic, publisher in self._publishers.items():
            if publisher.get_subscription_count() != self._listening(topic):
                return (
                    f"a node does not connect with {topic}, on which evoros publishes with the "
                    f"qualities of service reliable and volatile"
                )
        return None

    def _listening(self, topic: str) -> int:
        return int(self._node.count_subscribers(self._publishers[topic].topic_name))


class Incoming:
    """The messages of one publisher; no thread receives them, the bridge fetches them."""

    def __init__(self, node: Any, topic: str, publisher: Any) -> None:
        """Subscribe to the topic as reliably as it is published.

        Raises:
            ValueError: this Python has no messages of this kind.
        """
        kind = publisher.topic_type
        package, _, name = kind.replace("/msg/", "/").partition("/")
        try:
            self._class = getattr(importlib.import_module(f"{package}.msg"), name)
        except (ImportError, AttributeError):
            told = f"{sys.executable} cannot import {kind}, the messages of {topic}"
            raise ValueError(told) from None
        quality = QoSProfile(depth=DEPTH, reliability=publisher.qos_profile.reliability)
        # The callback is for messages from before the mission, which nobody hears.
        self._subscription = node.create_subscription(self._class, topic, _ignore, quality)

    def connected(self) -> bool:
        """Whether the publisher is matched; Humble does not tell."""
        count = getattr(self._subscription, "get_publisher_count", None)
        return count is None or count() > 0

    def fetch(self) -> list[Any]:
        """Return the messages that have arrived. An executor would take a hundred times as long."""
        messages, handle = [], self._subscription.handle
        with handle:
            while (taken := handle.take_message(self._class, False)) is not None:
                messages.append(taken[0])
        return messages


def _ignore(message: object) -> None:
    pass


class Graph:
    """Who is in the graph of the mission, and whether every connection stands."""

    def __init__(
        self, groups: list[Group], kinds: Mapping[str, type], kept: Collection[str]
    ) -> None:
        """``kinds``: of the messages of each topic; ``kept``: topics with messages for all time."""
        rclpy.init(args=[])
        self._node = rclpy.create_node(
            NAME, use_global_arguments=False, enable_rosout=False, start_parameter_services=False
        )
        self._clients: dict[str, Any] = {}  # by the name of the node that is asked
        self._answers: dict[str, Any] = {}
        self._topics = sorted(kinds.keys() - {CLOCK})  # to which every node listens
        # Nodes also tell each other transforms, so that all know that topic by its own name.
        shared = {topic: kind for topic, kind in kinds.items() if topic == TRANSFORMS}
        others = {topic: kind for topic, kind in kinds.items() if topic != TRANSFORMS}
        self.outlets = [Outlet(self._node, Group("", []), shared, kept)]
        self.outlets += [Outlet(self._node, group, others, kept) for group in groups]

    def missing(self, command_topic: str) -> str | None:
        """Name a thing for which the start of the mission waits; None: nothing."""
        for outlet in self.outlets:
            missing = outlet.missing()
            if missing is not None:
                return missing
        if not self._node.count_publishers(command_topic):
            return f"no node publishes on {command_topic}"
        if not any(outlet.hears(topic) for outlet in self.outlets for topic in self._topics):
            return f"no node listens to {', '.join(self._topics)}"
        return None

    def unanswered(self) -> str | None:
        """Ask each node for a parameter; name a thing that is missing until all have answered.

        This process knows when it is connected with a node, but only an answer proves that the
        node is too. A node learns of connections in the order in which they were made, and those
        by which it is asked are the last ones.
        """
        for name, namespace in sorted(self._listeners()):
            if name == UNKNOWN:
                return "a node has not told its name"
            place = f"{namespace.rstrip('/')}/{name}"
            services = self._node.get_service_names_and_types_by_node(name, namespace)
            asked = f"{place}/get_parameters" in dict(services)
            if asked and not self._has_answered(place):
                return f"the node {place} does not answer, as a node does that spins"
        return None

    def _listeners(self) -> set[tuple[str, str]]:
        """Return name and namespace of all nodes that listen to this process.

        The graph knows a connection before the name of its node, and the services of a node,
        which are created before its connections, before both.
        """
        topics = [topic for outlet in self.outlets for topic in outlet.names()]
        listening = [self._node.get_subscriptions_info_by_topic(topic) for topic in topics]
        return {(node.node_name, node.node_namespace) for nodes in listening for node in nodes}

    def _has_answered(self, place: str) -> bool:
        """Ask a node once, and tell whether its answer has come."""
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
        """Connect with the node that publishes on a topic; None if there is none.

        ``connected`` is the earlier connection. Only later may a second node be known.

        Raises:
            ValueError: there are several, or their messages are not of these kinds.
        """
        publishers = self._node.get_publishers_info_by_topic(topic)
        names = sorted(publisher.node_name for publisher in publishers)
        if not publishers or UNKNOWN in names:
            return connected
        if len(publishers) > 1:
            raise ValueError(
                f"{topic}: one node must publish there, not {len(names)} ({', '.join(names)}), "
                f"because the last message counts; give one of them another topic"
            )
        if connected is not None:
            return connected
        kind = publishers[0].topic_type
        if kind.rpartition("/")[2] not in kinds:
            raise ValueError(
                f"{topic}: its messages must be {' or '.join(kinds)}, not {kind}; correct the node "
                f"{names[0]} or controller.topics"
            )
        return Incoming(self._node, topic, publishers[0])
