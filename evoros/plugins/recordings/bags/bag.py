"""Missions as rosbags, with the agent's name in topics and frames; robots share ``/tf``."""

import argparse
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from evoros.analysis.subcommands import Product
from evoros.analysis.tables.study import Study
from evoros.base.errors import InputError, write_count
from evoros.plugins.recordings.bags import messages as ros
from evoros.plugins.recordings.missions import RecordedMission, add_missions, choose_missions

TEMPLATE = Path(__file__).with_name("foxglove.json")  # panels of the layout, without topics
SHOWN = (
    "visualization_msgs/msg/MarkerArray",
    "nav_msgs/msg/Path",
    "geometry_msgs/msg/PoseStamped",
    ros.SCAN,
)
"""Message types shown in the 3D view, in addition to frames and the robot."""
MOTION = {
    "/odom.twist.twist.linear.x": "speed [m/s]",
    "/ackermann_cmd.drive.steering_angle": "steering command [rad]",
}
IMU_FIELDS = {
    "angular_velocity.z": "yaw rate [rad/s]",
    "linear_acceleration.x": "forward [m/s2]",
    "linear_acceleration.y": "left [m/s2]",
}
TWIST_FIELDS = {"twist.linear.x": "speed [m/s]", "twist.angular.z": "yaw rate [rad/s]"}
STATES = {"/mode.data": "mode", "/contact.data": "contact"}


def make_layout(topics: Sequence[ros.Topic], robot_frame: str, agents: Sequence[str] = ()) -> str:
    """Return a Foxglove layout for bags with these topics."""
    ranges = _find_series(topics, {ros.RANGE: {"range": ""}})
    moved = _find_series(topics, {ros.IMU: IMU_FIELDS, ros.TWIST: TWIST_FIELDS})
    states = {**_of_all(STATES, agents), **_find_series(topics, {ros.SWITCH: {"data": ""}})}
    layout: dict[str, Any] = json.loads(TEMPLATE.read_text())
    panels = layout["configById"]
    shown = ["/robot_description", *(topic.name for topic in topics if topic.type in SHOWN)]
    panels["3D!scene"]["followTf"] = robot_frame
    panels["3D!scene"]["topics"] = {name: {"visible": True} for name in shown}
    layers = panels["3D!scene"]["layers"]
    agent = layers.pop("agent")
    for name in agents:
        topic, prefix = f"/{name}/robot_description", f"{name}/"
        new = {"instanceId": name, "label": name, "topic": topic, "framePrefix": prefix}
        layers[name] = {**agent, **new}
    panels["Plot!ranges"]["paths"] = _paths(ranges)
    panels["Plot!motion"]["paths"] = _paths({**_of_all(MOTION, agents), **moved})
    panels["StateTransitions!mode"]["paths"] = _paths(states)
    return json.dumps(layout, indent=1) + "\n"


def _find_series(
    topics: Sequence[ros.Topic], fields: Mapping[str, Mapping[str, str]]
) -> dict[str, str]:
    return {
        f"{topic.name}.{field}": f"{topic.name.removeprefix('/')} {words}".rstrip()
        for topic in topics
        for field, words in fields.get(topic.type, {}).items()
    }


def _of_all(series: Mapping[str, str], agents: Sequence[str]) -> dict[str, str]:
    others = {f"/{name}{path}": f"{name} {series[path]}" for name in agents for path in series}
    return {**series, **others}


def _paths(series: Mapping[str, str]) -> list[Mapping[str, Any]]:
    return [
        {"value": path, "label": label, "enabled": True, "timestampMethod": "receiveTime"}
        for path, label in series.items()
    ]


FRAMES, FIXED_FRAMES = "/tf", "/tf_static"
_OF_ALL = (FRAMES, FIXED_FRAMES, "/obstacles", ros.WALKERS.name)  # topics shared by all robots
_FRAME_FIELDS = ("frame_id", "child_frame_id")
WORST_MISSION = True
HELP = "recorded missions as rosbags, with a layout for Foxglove"
NEEDS = "a run or an evaluation that recorded trajectories, and the package rosbags"
FILES = ("bag_WORLD/", "bag_GENERATION_DESIGN_WORLD_TRIAL/", "bag.foxglove.json")
FORMATS = {"mcap": "rosbag2, also for Foxglove", "ros1": "for rosbag play"}
OUTPUT = "bags"
DISTRO = "jazzy"
LAYOUT = "bag.foxglove.json"
GOALS = {"mcap": "/goal_pose", "ros1": "/move_base_simple/goal"}  # topics of next waypoints


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options for missions and message definitions."""
    add_missions(parser)
    about = "ROS 2 distribution of the message definitions; jazzy (default) suits iron and later"
    parser.add_argument("--distro", choices=("humble", "jazzy"), help=about)


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Make one bag per mission, and a layout."""
    if options.format == "ros1" and options.distro:
        raise InputError("--distro: applies only to --format mcap; remove --distro, or use mcap")
    record, missions = choose_missions(study, options)
    topics = _list_team_topics(missions[0], GOALS[options.format])
    layout = make_layout(topics, missions[0].root, list(missions[0].others))
    files = {LAYOUT: layout.encode()}
    for mission in missions:
        files |= _write(mission, options.format, options.distro or DISTRO)
    message = f"{record.name}: {write_count(len(missions), 'mission')}"
    return Product(messages=[message], files=files)


def _write(mission: RecordedMission, kind: str, distro: str) -> dict[str, bytes]:
    from evoros.plugins.recordings.bags.writing import write_mcap, write_ros1

    name, goal = f"bag_{mission.name}", GOALS[kind]
    topics, messages = _list_team_topics(mission, goal), _list_team_messages(mission, goal)
    if kind == "ros1":
        return write_ros1(name, topics, messages)
    return write_mcap(name, topics, messages, distro)


def _list_team_topics(mission: RecordedMission, goal: str) -> list[ros.Topic]:
    others = [
        topic._replace(name=f"/{name}{topic.name}")
        for name, other in mission.others.items()
        for topic in ros.list_topics(other, goal)
        if topic.name not in _OF_ALL
    ]
    return [*ros.list_topics(mission, goal), *others]


def _list_team_messages(mission: RecordedMission, goal: str) -> list[ros.Message]:
    messages = ros.list_messages(mission, goal)
    if not mission.others:
        return messages
    for name, other in mission.others.items():
        heard = ros.list_messages(other, goal)
        for stamp, topic, content in heard:
            own = topic if topic in _OF_ALL else f"/{name}{topic}"
            if topic != "/obstacles":
                messages.append(ros.Message(stamp, own, _rename_frames(name, content)))
    fixed = [message for message in messages if message.topic == FIXED_FRAMES]
    # A latched topic keeps only its last message, so all fixed frames go into one message.
    frames = [frame for message in fixed for frame in message.content["transforms"]]
    moving = [message for message in messages if message.topic != FIXED_FRAMES]
    joined = fixed[0]._replace(content={"transforms": frames})
    return sorted([joined, *moving], key=lambda message: message.stamp_ns)


def _rename_frames(name: str, content: Any) -> Any:
    if isinstance(content, Mapping):
        return {
            key: f"{name}/{value}"
            if key in _FRAME_FIELDS and value != ros.WORLD_FRAME
            else _rename_frames(name, value)
            for key, value in content.items()
        }
    if isinstance(content, list):
        return [_rename_frames(name, value) for value in content]
    return content
