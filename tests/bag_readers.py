"""Readers of bags that share nothing with the library that writes them."""

import io
import json
import subprocess
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

DEBIAN = "/usr/bin/python3"
_ROSBAG = """
import json, sys, rosbag

def plain(value):
    if hasattr(value, "__slots__"):
        return {name: plain(getattr(value, name)) for name in value.__slots__}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    return value

bag = rosbag.Bag(sys.argv[1])
for topic, message, stamp in bag.read_messages():
    print(json.dumps([topic, stamp.to_nsec(), plain(message)]))
for c in bag._get_connections():
    latching = c.header["latching"] == b"1"
    print(json.dumps([c.topic, c.datatype, c.md5sum, latching]), file=sys.stderr)
"""


class ReadMessage(NamedTuple):
    topic: str
    stamp: int
    content: dict[str, Any]


def read_rosbag(path: Path) -> tuple[list[ReadMessage], list[list[Any]]]:
    """Messages, and topic, type, hash and latching of the connections, by Debian's rosbag."""
    command = [DEBIAN, "-c", _ROSBAG, str(path)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    messages = [ReadMessage(*json.loads(line)) for line in done.stdout.splitlines()]
    connections = [json.loads(line) for line in done.stderr.splitlines() if line.startswith("[")]
    return [_renamed(message) for message in messages], connections


def read_mcap(path: Path) -> list[ReadMessage]:
    """Messages by the libraries of MCAP."""
    reader = make_reader(io.BytesIO(path.read_bytes()), decoder_factories=[DecoderFactory()])
    return [
        ReadMessage(channel.topic, message.log_time, _plain(decoded))
        for _, channel, message, decoded in reader.iter_decoded_messages()
    ]


def channels(path: Path) -> set[str]:
    summary = make_reader(io.BytesIO(path.read_bytes())).get_summary()
    assert summary is not None
    return {channel.topic for channel in summary.channels.values()}


def _plain(value: Any) -> Any:
    if hasattr(value, "__slots__"):
        return {name: _plain(getattr(value, name)) for name in value.__slots__}
    if isinstance(value, bytes | bytearray):
        return list(value)
    if isinstance(value, Iterable) and not isinstance(value, str):
        return [_plain(item) for item in value]
    return value


def _renamed(message: ReadMessage) -> ReadMessage:
    """With ROS 2's names of the fields of a stamp."""

    def renamed(value: Any) -> Any:
        if isinstance(value, list):
            return [renamed(item) for item in value]
        if not isinstance(value, dict):
            return value
        names = {"secs": "sec", "nsecs": "nanosec"}
        return {names.get(k, k): renamed(v) for k, v in value.items() if k != "seq"}

    return message._replace(content=renamed(message.content))
