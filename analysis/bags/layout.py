"""A layout for Foxglove and Lichtblick, in the form in which they export and import layouts."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from .protocol import Topic
from .sensors import IMU, RANGE, SCAN, SWITCH, TWIST

TEMPLATE = Path(__file__).with_name("foxglove.json")
"""The panels, without the topics of a bag."""
SHOWN = (
    "visualization_msgs/msg/MarkerArray",
    "nav_msgs/msg/Path",
    "geometry_msgs/msg/PoseStamped",
    SCAN,
)
"""Types that the three-dimensional view shows besides the frames and the robot."""
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


def make_layout(topics: Sequence[Topic], robot_frame: str, agents: Sequence[str] = ()) -> str:
    """Return the layout for bags with these topics: the scene on the left, readings beside it."""
    ranges = _find_series(topics, {RANGE: {"range": ""}})
    moved = _find_series(topics, {IMU: IMU_FIELDS, TWIST: TWIST_FIELDS})
    states = {**_of_all(STATES, agents), **_find_series(topics, {SWITCH: {"data": ""}})}
    layout: dict[str, Any] = json.loads(TEMPLATE.read_text())
    panels = layout["configById"]
    shown = ["/robot_description", *(topic.name for topic in topics if topic.type in SHOWN)]
    panels["3D!scene"]["followTf"] = robot_frame
    panels["3D!scene"]["topics"] = {name: {"visible": True} for name in shown}
    panels["3D!scene"]["layers"] |= {name: _show_agent(name) for name in agents}
    panels["Plot!ranges"]["paths"] = _paths(ranges)
    panels["Plot!motion"]["paths"] = _paths({**_of_all(MOTION, agents), **moved})
    panels["StateTransitions!mode"]["paths"] = _paths(states)
    return json.dumps(layout, indent=1) + "\n"


def _find_series(
    topics: Sequence[Topic], fields: Mapping[str, Mapping[str, str]]
) -> dict[str, str]:
    """Return the label of each plotted field; ``fields`` has words for fields by type."""
    return {
        f"{topic.name}.{field}": f"{topic.name.removeprefix('/')} {words}".rstrip()
        for topic in topics
        for field, words in fields.get(topic.type, {}).items()
    }


def _of_all(series: Mapping[str, str], agents: Sequence[str]) -> dict[str, str]:
    """Return the labels of the fields of the first robot and of the agents."""
    others = {
        f"/{name}{path}": f"{name} {words}" for name in agents for path, words in series.items()
    }
    return {**series, **others}


def _show_agent(name: str) -> Mapping[str, Any]:
    """Return the layer of an agent's description, whose frames have its name before them."""
    return {
        "instanceId": name,
        "layerId": "foxglove.Urdf",
        "label": name,
        "visible": True,
        "frameLocked": True,
        "sourceType": "topic",
        "topic": f"/{name}/robot_description",
        "framePrefix": f"{name}/",
        "displayMode": "auto",
    }


def _paths(series: Mapping[str, str]) -> list[Mapping[str, Any]]:
    return [
        {"value": path, "label": label, "enabled": True, "timestampMethod": "receiveTime"}
        for path, label in series.items()
    ]
