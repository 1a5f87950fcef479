"""Writes messages as a rosbag2 (MCAP) or ROS 1 bag, with the library rosbags."""

import tempfile
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, Literal

import numpy as np

from evoros.base.errors import require_extra
from evoros.plugins.recordings.bags.messages import Message, Topic

with require_extra("bags", "evoros analyze bag"):
    from rosbags import interfaces, rosbag1, rosbag2
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    from rosbags.typesys.store import Typestore

DISTROS = {"humble": Stores.ROS2_HUMBLE, "jazzy": Stores.ROS2_JAZZY}
"""Message definitions by distribution; those for jazzy also suit iron, kilted and later."""
METADATA_VERSION: Literal[8] = 8  # latest rosbag2 version that humble can read
OTHER_TYPES = {
    "tf2_msgs/msg/TFMessage": "geometry_msgs/TransformStamped[] transforms",
    "ackermann_msgs/msg/AckermannDrive": "float32 steering_angle\n"
    "float32 steering_angle_velocity\nfloat32 speed\nfloat32 acceleration\nfloat32 jerk",
    "ackermann_msgs/msg/AckermannDriveStamped": "std_msgs/Header header\n"
    "ackermann_msgs/AckermannDrive drive",
}
"""Message definitions missing from some type stores of rosbags."""
_ZERO: Mapping[str, Any] = {"string": "", "bool": False, "float32": 0.0, "float64": 0.0}


def write_mcap(
    name: str, topics: Sequence[Topic], messages: Sequence[Message], distro: str
) -> dict[str, bytes]:
    """Return the files of a rosbag2, metadata and MCAP, for one of ``DISTROS``."""
    store = _complete(DISTROS[distro])
    with tempfile.TemporaryDirectory() as folder:
        path, plugin = Path(folder) / name, rosbag2.StoragePlugin.MCAP
        writer = rosbag2.Writer(path, version=METADATA_VERSION, storage_plugin=plugin)
        writer.set_compression(rosbag2.CompressionMode.STORAGE, rosbag2.CompressionFormat.ZSTD)
        qualities = [{"offered_qos_profiles": [_quality(topic.latched)]} for topic in topics]
        _write(writer, store, store.serialize_cdr, topics, qualities, messages)
        return {f"{name}/{file.name}": file.read_bytes() for file in sorted(path.iterdir())}


def write_ros1(name: str, topics: Sequence[Topic], messages: Sequence[Message]) -> dict[str, bytes]:
    """Return the file of a ROS 1 bag, keyed by name."""
    store = _complete(Stores.ROS1_NOETIC)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{name}.bag"
        writer = rosbag1.Writer(path)
        writer.set_compression(rosbag1.Writer.CompressionFormat.BZ2)
        qualities = [{"callerid": "/evoros", "latching": int(topic.latched)} for topic in topics]
        _write(writer, store, store.serialize_ros1, topics, qualities, messages)
        return {path.name: path.read_bytes()}


def _write(
    writer: Any,
    store: Typestore,
    serialize: Callable[[Any, str], Any],
    topics: Sequence[Topic],
    qualities: Sequence[Mapping[str, Any]],
    messages: Sequence[Message],
) -> None:
    """Write messages to a bag; ``qualities`` holds additional arguments for each connection."""
    with writer:
        connections = {
            topic.name: writer.add_connection(topic.name, topic.type, typestore=store, **quality)
            for topic, quality in zip(topics, qualities, strict=True)
        }
        for stamp, name, content in messages:
            kind = connections[name].msgtype
            data = serialize(_build(store, kind, content), kind)
            writer.write(connections[name], stamp, bytes(data))


@cache
def _complete(collection: Stores) -> Typestore:
    store = get_typestore(collection)
    for name, text in OTHER_TYPES.items():
        if name not in store.types:
            store.register(get_types_from_msg(text, name))
    return store


def _quality(latched: bool) -> interfaces.Qos:
    never, durability = interfaces.QosTime(9223372036, 854775807), interfaces.QosDurability
    return interfaces.Qos(
        history=interfaces.QosHistory.KEEP_LAST,
        depth=1 if latched else 10,
        reliability=interfaces.QosReliability.RELIABLE,
        durability=durability.TRANSIENT_LOCAL if latched else durability.VOLATILE,
        deadline=never,
        lifespan=never,
        liveliness=interfaces.QosLiveliness.AUTOMATIC,
        liveliness_lease_duration=never,
        avoid_ros_namespace_conventions=False,
    )


def _build(store: Typestore, name: str, content: Mapping[str, Any]) -> Any:
    """Build a message; fields that ``content`` lacks are zero or empty."""
    fields = store.fielddefs[name][1]
    values = {field: _fill(store, kind, content.get(field)) for field, kind in fields}
    return store.types[name](**values)


def _fill(store: Typestore, kind: Any, value: Any) -> Any:
    node, description = kind
    if node == interfaces.Nodetype.BASE:
        return _ZERO.get(description[0], 0) if value is None else value
    if node == interfaces.Nodetype.NAME:
        return _build(store, description, value or {})
    (node, inner), size = description
    if node == interfaces.Nodetype.BASE:
        return np.zeros(size, dtype=inner[0]) if value is None else np.array(value, dtype=inner[0])
    return [_build(store, inner, item) for item in value or ()]
