"""The messages of several robots in a mission: agents have namespaces with their names.

The first robot has the names that it has alone. The frames of all robots are on ``/tf`` and
``/tf_static``, agents' frames with their names before them, as ROS has it for several robots.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from .messages import WALKERS, WORLD_FRAME, list_messages, list_topics
from .missions import RecordedMission
from .protocol import Message, Topic

FRAMES, FIXED_FRAMES = "/tf", "/tf_static"
OF_ALL = (FRAMES, FIXED_FRAMES, "/obstacles", WALKERS.name)
"""Topics that are there once."""
FRAME_FIELDS = ("frame_id", "child_frame_id")


def list_team_topics(mission: RecordedMission, goal: str) -> list[Topic]:
    """List the topics of all robots; see ``list_topics``."""
    others = [
        topic._replace(name=f"/{name}{topic.name}")
        for name, other in mission.others.items()
        for topic in list_topics(other, goal)
        if topic.name not in OF_ALL
    ]
    return [*list_topics(mission, goal), *others]


def list_team_messages(mission: RecordedMission, goal: str) -> list[Message]:
    """List the messages of all robots in the order of their stamps; see ``list_messages``."""
    messages = list_messages(mission, goal)
    if not mission.others:
        return messages
    for name, other in mission.others.items():
        heard = list_messages(other, goal)
        messages += [_place(name, message) for message in heard if message.topic != "/obstacles"]
    fixed = [message for message in messages if message.topic == FIXED_FRAMES]
    moving = [message for message in messages if message.topic != FIXED_FRAMES]
    return sorted([_join(fixed), *moving], key=lambda message: message.stamp_ns)


def _place(name: str, message: Message) -> Message:
    """Return the message of an agent in its namespace, with its frames."""
    topic = message.topic if message.topic in OF_ALL else f"/{name}{message.topic}"
    return message._replace(topic=topic, content=_rename_frames(name, message.content))


def _rename_frames(name: str, content: Any) -> Any:
    if isinstance(content, Mapping):
        return {
            key: f"{name}/{value}"
            if key in FRAME_FIELDS and value != WORLD_FRAME
            else _rename_frames(name, value)
            for key, value in content.items()
        }
    if isinstance(content, list):
        return [_rename_frames(name, value) for value in content]
    return content


def _join(messages: Sequence[Message]) -> Message:
    """Join the fixed frames in one message, because only the last one of a topic is kept."""
    transforms = [transform for m in messages for transform in m.content["transforms"]]
    return messages[0]._replace(content={"transforms": transforms})
