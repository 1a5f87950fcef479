"""Prints the messages of sensors of all kinds, in ROS 1's Python."""

import json
import sys

sys.path.insert(0, sys.argv[1])

from bridge import messages  # type: ignore[import-not-found]
from bridge.conversation import Tick  # type: ignore[import-not-found]
from genpy import Time

cone = {"range_min_m": 0.1, "range_max_m": 0.8, "field_of_view_rad": 0.1, "period_s": 0.1}
sensors = [
    {"name": "sonar_0", **cone},
    {"name": "infrared_1", "radiation": "infrared", **cone},
    {"name": "lidar_2", "bearings_rad": [-1.0, 1.0], **cone},
    {"name": "imu_3", "measures": "motion", "channels": list("abcdef"), "period_s": 0.1},
    {"name": "odometry_4", "measures": "wheels", "channels": ["v", "w"], "period_s": 0.1},
    {"name": "bumper_5", "measures": "contact", "channels": ["touch"], "period_s": 0.1},
]
names = ("range", "odometry", "goal", "route")
topics = {name: f"/{name}" for name in names} | {"range": "/{sensor}"}
briefing = {
    "ros": {
        "topics": topics,
        "frame": "map",
        "description": '<robot name="r"><link name="base"/></robot>',
    },
    "sensors": sensors,
    "home": [0.0, 0.0],
    "route": [[1.0, 0.0]],
}
made = messages.Messages(briefing, Time)
readings = [0.5, 0.6, [0.7, None], [1, 2, 3, 4, 5, 6], [0.3, 0.2], 1.0]
tick = Tick(0.0, [0.0] * 6, [0.0, 0.0, 1.0, 0.0], readings)
told = {}
for together in made.of(tick):
    for topic, message in together:
        told[topic] = [type(message).__name__, str(message)]
silent = Tick(0.1, [0.0] * 6, [0.0, 0.0, 1.0, 0.0], [None] * 6)
told["silent"] = [topic for together in made.of(silent) for topic, _ in together]
print(json.dumps(told))
