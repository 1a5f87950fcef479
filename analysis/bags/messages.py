"""The messages of a mission as plain values; fields of messages that are left out are empty."""

import math
from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import pandas as pd

from evoros.base.arrays import Array
from evoros.geometry.shapes import Pose

from ..tables.readings import RecordedSensor
from ..tables.tracks import NONE
from .markers import list_markers, mark_walker
from .missions import RecordedMission
from .protocol import Content, Message, Topic
from .sensors import WITHOUT_HEADER, choose_type, fill_message

START_NS = 1_000_000_000
"""The stamp at the start of a mission: to ROS, time 0 is no time."""
WORLD_FRAME = "odom"
_SAME_TIME = 1e-6  # share of a period within which two times are the same

TOPICS = (
    Topic("/robot_description", "std_msgs/msg/String", True),
    Topic("/tf_static", "tf2_msgs/msg/TFMessage", True),
    Topic("/obstacles", "visualization_msgs/msg/MarkerArray", True),
    Topic("/route", "nav_msgs/msg/Path", True),
    Topic("/tf", "tf2_msgs/msg/TFMessage"),
    Topic("/odom", "nav_msgs/msg/Odometry"),
    Topic("/ackermann_cmd", "ackermann_msgs/msg/AckermannDriveStamped"),
    Topic("/mode", "std_msgs/msg/String"),
    Topic("/contact", "std_msgs/msg/Bool"),
)
"""The topics besides the goal, the walkers and the sensors."""
WALKERS = Topic("/walkers", "visualization_msgs/msg/MarkerArray")


def list_topics(mission: RecordedMission, goal: str) -> list[Topic]:
    """List the topics of a mission's bag; ``goal`` is the topic of the next waypoint."""
    sensors = [Topic(f"/{sensor.link}", choose_type(sensor.kind)) for sensor in mission.sensors]
    walkers = [WALKERS] if mission.walkers else []
    return [*TOPICS, *walkers, Topic(goal, "geometry_msgs/msg/PoseStamped", True), *sensors]


def list_messages(mission: RecordedMission, goal: str) -> list[Message]:
    """List the messages of a mission in the order of their stamps; see ``list_topics``."""
    goals = _aim(mission, goal)
    messages = [*_describe(mission), *goals, *_move(mission), *_decide(mission)]
    messages += _show_walkers(mission)
    times = mission.trajectory["time_s"].to_numpy(float)
    for sensor in mission.sensors:
        messages += _measure(sensor, times)
    return sorted(messages, key=lambda message: message.stamp_ns)


def to_stamp(time_s: float) -> int:
    """Return the stamp [ns] of a time of a mission [s]."""
    return START_NS + round(time_s * 1e9)


def _describe(mission: RecordedMission) -> Iterator[Message]:
    """Yield what does not change: the robot, its frames, the obstacles and the route."""
    yield Message(START_NS, "/robot_description", {"data": mission.urdf})
    fixed = [
        _transform(START_NS, joint.parent, joint.child, joint.origin) for joint in mission.joints
    ]
    yield Message(START_NS, "/tf_static", {"transforms": fixed})
    header = _header(START_NS, WORLD_FRAME)
    markers = [{"header": header, **marker} for marker in list_markers(mission.world)]
    yield Message(START_NS, "/obstacles", {"markers": markers})
    poses = [{"header": header, "pose": _pose(goal)} for goal in _goals(mission)]
    yield Message(START_NS, "/route", {"header": header, "poses": poses})


def _aim(mission: RecordedMission, topic: str) -> Iterator[Message]:
    """Yield the next waypoint, whenever it changes."""
    rows, goals = mission.trajectory, _goals(mission)
    changes = rows[rows["visited"].diff() != 0]
    for time, visited in zip(changes["time_s"], changes["visited"], strict=True):
        if visited < len(goals):
            stamp = to_stamp(time)
            header = _header(stamp, WORLD_FRAME)
            yield Message(stamp, topic, {"header": header, "pose": _pose(goals[int(visited)])})


def _move(mission: RecordedMission) -> Iterator[Message]:
    """Yield pose, speed and contact of the robot."""
    rows, root = mission.trajectory, mission.root
    rates = _yaw_rates(rows)
    for row, rate in zip(rows.to_dict("records"), rates, strict=True):
        stamp = to_stamp(row["time_s"])
        pose = _at(row["x_m"], row["y_m"], row["yaw_rad"]) @ mission.root_pose
        yield Message(stamp, "/tf", {"transforms": [_transform(stamp, WORLD_FRAME, root, pose)]})
        twist = {"linear": {"x": row["speed_mps"]}, "angular": {"z": rate}}
        odometry = {
            "header": _header(stamp, WORLD_FRAME),
            "child_frame_id": root,
            "pose": {"pose": _pose(pose)},
            "twist": {"twist": twist},
        }
        yield Message(stamp, "/odom", odometry)
        yield Message(stamp, "/contact", {"data": bool(row["contact"])})


def _show_walkers(mission: RecordedMission) -> Iterator[Message]:
    """Yield the markers of all walkers at each record, if there are any."""
    times = mission.trajectory["time_s"].tolist() if mission.walkers else []
    for record, time in enumerate(times):
        stamp = to_stamp(time)
        header = _header(stamp, WORLD_FRAME)
        markers = [{"header": header, **mark_walker(walker, record)} for walker in mission.walkers]
        yield Message(stamp, WALKERS.name, {"markers": markers})


def _decide(mission: RecordedMission) -> Iterator[Message]:
    """Yield commands and modes; the last record, the end of the mission, has no decision."""
    names = (NONE, *mission.modes)
    for row in mission.trajectory.iloc[:-1].to_dict("records"):
        stamp = to_stamp(row["time_s"])
        drive = {"steering_angle": row["steering_rad"], "speed": row["speed_mps"]}
        command = {"header": _header(stamp, mission.root), "drive": drive}
        yield Message(stamp, "/ackermann_cmd", command)
        yield Message(stamp, "/mode", {"data": names[int(row["mode"])]})


def _measure(sensor: RecordedSensor, times: Array) -> Iterator[Message]:
    """Yield the readings that a sensor took, each once, stamped with the time of its sampling.

    A record has the last reading of each sensor, which may be older. The end samples none.
    """
    period = sensor.kind.period_s
    samples = np.floor(times / period + _SAME_TIME)
    samples[-1] = math.ceil(times[-1] / period - _SAME_TIME) - 1
    before = np.concatenate([[-1.0], samples[:-1]])
    for row in np.flatnonzero(samples > before).tolist():
        stamp = to_stamp(float(samples[row]) * period)
        content = fill_message(sensor.kind, sensor.readings[row].tolist())
        if content is not None:
            if choose_type(sensor.kind) not in WITHOUT_HEADER:
                content = {"header": _header(stamp, sensor.link), **content}
            yield Message(stamp, f"/{sensor.link}", content)


def _yaw_rates(rows: pd.DataFrame) -> list[float]:
    """Return the yaw rates [rad/s] from the headings of the records around each record."""
    time, yaw = rows["time_s"].to_numpy(float), np.unwrap(rows["yaw_rad"].to_numpy(float))
    after, before = (np.clip(np.arange(len(rows)) + i, 0, len(rows) - 1) for i in (1, -1))
    turned, elapsed = yaw[after] - yaw[before], time[after] - time[before]
    rates: list[float] = (turned / np.where(elapsed > 0.0, elapsed, 1.0)).tolist()
    return rates


def _goals(mission: RecordedMission) -> list[Pose]:
    """Return the poses of the waypoints, each of which looks along the way to it."""
    places = [mission.world.course.home[:2], *mission.route.tolist()]
    return [
        _at(x, y, math.atan2(y - from_y, x - from_x))
        for (from_x, from_y), (x, y) in pairwise(places)
    ]


def _at(x: float, y: float, yaw: float) -> Pose:
    return Pose.from_rpy((float(x), float(y), 0.0), 0.0, 0.0, float(yaw))


def _header(stamp_ns: int, frame: str) -> Content:
    sec, nanosec = divmod(stamp_ns, 1_000_000_000)
    return {"stamp": {"sec": sec, "nanosec": nanosec}, "frame_id": frame}


def _transform(stamp_ns: int, parent: str, child: str, pose: Pose) -> Content:
    placed = _pose(pose)
    return {
        "header": _header(stamp_ns, parent),
        "child_frame_id": child,
        "transform": {"translation": placed["position"], "rotation": placed["orientation"]},
    }


def _pose(pose: Pose) -> Content:
    return {
        "position": dict(zip("xyz", pose.position, strict=True)),
        "orientation": dict(zip("xyzw", pose.quaternion, strict=True)),
    }
