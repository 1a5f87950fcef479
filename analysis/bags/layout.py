"""A layout for Foxglove and Lichtblick, in the form in which they export and import layouts."""

import json
from collections.abc import Mapping, Sequence
from typing import Any

from .messages import WORLD_FRAME, Topic

SHOWN = (
    "visualization_msgs/msg/MarkerArray",
    "nav_msgs/msg/Path",
    "geometry_msgs/msg/PoseStamped",
)
"""Types that the three-dimensional view shows besides the frames and the robot."""
SPEED = {"/odom.twist.twist.linear.x": "speed [m/s]"}
STEERING = {"/ackermann_cmd.drive.steering_angle": "steering command [rad]"}
STATES = {"/mode.data": "mode", "/contact.data": "contact"}


def make_layout(topics: Sequence[Topic], robot_frame: str) -> str:
    """Return the layout for bags with these topics.

    A view of the scene that follows the robot is on the left; readings, speed and steering, and
    the controller's mode are on the right.
    """
    ranges = {
        f"{topic.name}.range": topic.name.removeprefix("/")
        for topic in topics
        if topic.type == "sensor_msgs/msg/Range"
    }
    panels = {
        "3D!scene": _scene(robot_frame, topics),
        "Plot!ranges": _plot("Readings [m]", ranges),
        "Plot!motion": _plot("Speed and steering", {**SPEED, **STEERING}),
        "StateTransitions!mode": {"isSynced": True, "paths": _paths(STATES)},
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


def _split(direction: str, first: Any, second: Any, percentage: int) -> Mapping[str, Any]:
    return {
        "direction": direction,
        "first": first,
        "second": second,
        "splitPercentage": percentage,
    }


def _scene(robot_frame: str, topics: Sequence[Topic]) -> Mapping[str, Any]:
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
        "layers": {"ground": grid},
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
