"""The topics and messages of a bag, as plain values."""

from collections.abc import Mapping
from typing import Any, NamedTuple

Content = Mapping[str, Any]
"""The fields of a message by name; those that are left out are zero or empty."""


class Topic(NamedTuple):
    """A topic of a bag."""

    name: str
    type: str
    latched: bool = False  # its last message is also for those that listen later


class Message(NamedTuple):
    """A message of a bag; ``topic`` is a name."""

    stamp_ns: int
    topic: str
    content: Content
