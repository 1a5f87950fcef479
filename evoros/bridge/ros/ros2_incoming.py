"""The messages that a node of ROS 2 publishes for evoros.

Runs in the user's ROS Python.
"""

from __future__ import annotations

import importlib
import sys
from typing import Any

from rclpy.qos import QoSProfile

DEPTH = 100  # commands of one tick that are kept


class Incoming:
    """The messages of one publisher; no thread receives them, the bridge fetches them."""

    def __init__(self, node: Any, topic: str, publisher: Any) -> None:
        """Subscribe to the topic as reliably as it is published.

        Raises:
            ValueError: this Python has no messages of this kind.
        """
        package, _, name = publisher.topic_type.replace("/msg/", "/").partition("/")
        try:
            self._class = getattr(importlib.import_module(f"{package}.msg"), name)
        except (ImportError, AttributeError):
            kind = publisher.topic_type
            raise ValueError(
                f"{sys.executable} cannot import {kind}, the messages of {topic}"
            ) from None
        quality = QoSProfile(depth=DEPTH, reliability=publisher.qos_profile.reliability)
        # The callback is for messages from before the mission, which nobody hears.
        self._subscription = node.create_subscription(self._class, topic, _ignore, quality)

    def connected(self) -> bool:
        """Whether the publisher is matched; Humble does not tell."""
        count = getattr(self._subscription, "get_publisher_count", None)
        return count is None or count() > 0

    def fetch(self) -> list[Any]:
        """Return the messages that have arrived. An executor would take a hundred times as long."""
        messages = []
        handle = self._subscription.handle
        with handle:
            taken = handle.take_message(self._class, False)
            while taken is not None:
                messages.append(taken[0])
                taken = handle.take_message(self._class, False)
        return messages


def _ignore(message: object) -> None:
    pass
