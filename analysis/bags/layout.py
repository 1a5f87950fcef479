"""A layout for Foxglove and Lichtblick, in the form in which they export and import layouts."""

import json
from collections.abc import Mapping, Sequence
from typing import Any

from .messages import WORLD_FRAME
from .protocol import Topic
from .sensors import IMU, RANGE, SCAN, SWITCH, TWIST

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
    panels = {
        "3D!scene": _scene(robot_frame, topics, agents),
        "Plot!ranges": _plot("Readings [m]", ranges),
        "Plot!motion": _plot("Speed and steering", {**_of_all(MOTION, agents), **moved}),
        "StateTransitions!mode": {"isSynced": True, "paths": _paths(states)},
    }
    lower = _split("column", "Plot!motion", "StateTransitions!mode", 60)
    layout = {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": _split("row", "3D!scene", _split("column", "Plot!ranges", lower, 45), 60),
    }
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
    """Return the labels of the fields of the first robot and of those of the agents."""
    others = {
        f"/{name}{path}": f"{name} {words}" for name in agents for path, words in series.items()
    }
    return {**series, **others}


def _split(direction: str, first: Any, second: Any, percentage: int) -> Mapping[str, Any]:
    return {"direction": direction, "first": first, "second": second, "splitPercentage": percentage}


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


def _scene(robot_frame: str, topics: Sequence[Topic], agents: Sequence[str]) -> Mapping[str, Any]:
    shown = ["/robot_description", *(topic.name for topic in topics if topic.type in SHOWN)]
    grid = {
        "instanceId": "ground",
        "layerId": "foxglove.Grid",
        "label": "Ground",
        "visible": True,
        "frameId": WORLD_FRAME,
        "size": 100,
        "divisions": 100,
        "lineWidth": 1,
        "color": "#80808040",
        "position": [0, 0, 0],
        "rotation": [0, 0, 0],
    }
    return {
        "followMode": "follow-position",
        "followTf": robot_frame,
        "cameraState": {
            "perspective": True,
            "distance": 6,
            "phi": 50,
            "thetaOffset": 90,
            "target": [0, 0, 0],
            "targetOffset": [0, 0, 0],
            "targetOrientation": [0, 0, 0, 1],
            "fovy": 45,
            "near": 0.1,
            "far": 500,
        },
        "scene": {"transforms": {"showLabel": False, "axisScale": 0.2, "enablePreloading": True}},
        "transforms": {},
        "topics": {name: {"visible": True} for name in shown},
        "layers": {"ground": grid, **{name: _show_agent(name) for name in agents}},
    }


def _plot(title: str, series: Mapping[str, str]) -> Mapping[str, Any]:
    return {
        "title": title,
        "foxglovePanelTitle": title,
        "paths": _paths(series),
        "isSynced": True,
        "showLegend": True,
        "legendDisplay": "floating",
        "showXAxisLabels": True,
        "showYAxisLabels": True,
        "xAxisVal": "timestamp",
    }


def _paths(series: Mapping[str, str]) -> list[Mapping[str, Any]]:
    return [
        {"value": path, "label": label, "enabled": True, "timestampMethod": "receiveTime"}
        for path, label in series.items()
    ]
