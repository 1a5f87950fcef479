"""The publishers with which a mission appears in the graph of ROS 1.

Runs in the user's ROS Python.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import genpy
import rospy

if TYPE_CHECKING:
    from evoros.bridge.ros.conversation import Tick
    from evoros.bridge.ros.messages import Messages
else:
    from messages import Messages


class Outgoing:
    """What this process publishes: its publishers, and the messages of a tick."""

    def __init__(self, briefing: dict[str, Any]) -> None:
        self._messages = Messages(briefing, genpy.Time)
        topics = briefing["ros"]["topics"]
        latched = {topics["goal"], topics["route"]}
        self._publishers = {
            topic: _publisher(topic, kind, topic in latched)
            for topic, kind in self._messages.kinds().items()
        }
        topic, route = self._messages.route()
        self._publishers[topic].publish(route)

    def publishers(self) -> list[Any]:
        """Return all publishers."""
        return list(self._publishers.values())

    def messages(self, tick: Tick) -> Iterator[tuple[Any, Any]]:
        """Yield publishers and messages in the order in which the nodes shall get them."""
        for together in self._messages.of(tick):
            for topic, message in together:
                yield self._publishers[topic], message


def _publisher(topic: str, kind: type, latch: bool) -> Any:
    """Create a publisher that sends at once, not by the thread of a queue as rospy advises."""
    warnings.filterwarnings("ignore", "The publisher should be created", SyntaxWarning)
    return rospy.Publisher(topic, kind, queue_size=None, tcp_nodelay=True, latch=latch)
