"""The ROS messages of a mission, as plain Python values."""

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from evoros.analysis.tables.readings import RecordedSensor, WalkerTrack
from evoros.analysis.tables.tracks import NONE
from evoros.base.arrays import Array
from evoros.geometry.polyhedron import convex_polyhedron
from evoros.geometry.shapes import Pose, Shape
from evoros.plugins.recordings.missions import RecordedMission
from evoros.sensor.protocol import CONTACT, MOTION, WHEELS
from evoros.storage.figure_context import Beam, Signal
from evoros.world.model import World
from evoros.world.standing import standing_obstacles

Content = Mapping[str, Any]  # fields of a message by name; missing fields are zero or empty


class Topic(NamedTuple):
    """A topic of a bag."""

    name: str
    type: str
    latched: bool = False  # whether later subscribers receive the last message


class Message(NamedTuple):
    """A message of a bag."""

    stamp_ns: int
    topic: str
    content: Content


RANGE, SCAN = "sensor_msgs/msg/Range", "sensor_msgs/msg/LaserScan"
IMU, TWIST = "sensor_msgs/msg/Imu", "geometry_msgs/msg/TwistStamped"
SWITCH, NUMBERS = "std_msgs/msg/Bool", "std_msgs/msg/Float64MultiArray"
_SIGNALS = {(MOTION, 6): IMU, (WHEELS, 2): TWIST, (CONTACT, 1): SWITCH}
_RADIATIONS = {"ultrasound": 0, "infrared": 1}  # constants of sensor_msgs/Range
_WITHOUT_HEADER = (SWITCH, NUMBERS)
_NO_ORIENTATION = (-1.0, *(0.0,) * 8)
CUBE, _SPHERE, CYLINDER, TRIANGLE_LIST = 1, 2, 3, 11
FIXED, _MOVABLE, WALKER = (0.56, 0.61, 0.68), (0.82, 0.65, 0.42), (0.85, 0.45, 0.15)
START_NS = 1_000_000_000  # stamp [ns] of the start of a mission, because ROS treats 0 as unset
WORLD_FRAME = "odom"
_SAME_TIME = 1e-6  # fraction of a period below which two times are equal

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
"""All topics except the topics of the goal, the walkers and the sensors."""
WALKERS = Topic("/walkers", "visualization_msgs/msg/MarkerArray")


def list_topics(mission: RecordedMission, goal: str) -> list[Topic]:
    """List the topics of a mission's bag; ``goal`` is the topic of the next waypoint."""
    sensors = [Topic(f"/{sensor.link}", _choose_type(sensor.kind)) for sensor in mission.sensors]
    walkers = [WALKERS] if mission.walkers else []
    return [*TOPICS, *walkers, Topic(goal, "geometry_msgs/msg/PoseStamped", True), *sensors]


def list_messages(mission: RecordedMission, goal: str) -> list[Message]:
    """List the messages of a mission, ordered by stamp; see ``list_topics``."""
    messages = [*_describe(mission), *_aim(mission, goal), *_move(mission), *_decide(mission)]
    messages += _show_walkers(mission)
    times = mission.trajectory["time_s"].to_numpy(float)
    for sensor in mission.sensors:
        messages += _measure(sensor, times)
    return sorted(messages, key=lambda message: message.stamp_ns)


def to_stamp(time_s: float) -> int:
    """Convert a mission time [s] to a stamp [ns]."""
    return START_NS + round(time_s * 1e9)


def _describe(mission: RecordedMission) -> Iterator[Message]:
    yield Message(START_NS, "/robot_description", {"data": mission.urdf})
    fixed = [_transform(START_NS, j.parent, j.child, j.origin) for j in mission.joints]
    yield Message(START_NS, "/tf_static", {"transforms": fixed})
    header = _header(START_NS, WORLD_FRAME)
    markers = [{"header": header, **marker} for marker in _list_markers(mission.world)]
    yield Message(START_NS, "/obstacles", {"markers": markers})
    poses = [{"header": header, "pose": _pose(goal)} for goal in _goals(mission)]
    yield Message(START_NS, "/route", {"header": header, "poses": poses})


def _aim(mission: RecordedMission, topic: str) -> Iterator[Message]:
    rows, goals = mission.trajectory, _goals(mission)
    changes = rows[rows["visited"].diff() != 0]
    for time, visited in zip(changes["time_s"], changes["visited"], strict=True):
        if visited < len(goals):
            stamp = to_stamp(time)
            header = _header(stamp, WORLD_FRAME)
            yield Message(stamp, topic, {"header": header, "pose": _pose(goals[int(visited)])})


def _move(mission: RecordedMission) -> Iterator[Message]:
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
    times = mission.trajectory["time_s"].tolist() if mission.walkers else []
    for record, time in enumerate(times):
        stamp = to_stamp(time)
        header = _header(stamp, WORLD_FRAME)
        markers = [{"header": header, **mark_walker(walker, record)} for walker in mission.walkers]
        yield Message(stamp, WALKERS.name, {"markers": markers})


def _decide(mission: RecordedMission) -> Iterator[Message]:
    """Yield commands and modes; at the last record there is no decision."""
    names = (NONE, *mission.context.modes)
    for row in mission.trajectory.iloc[:-1].to_dict("records"):
        stamp = to_stamp(row["time_s"])
        drive = {"steering_angle": row["steering_rad"], "speed": row["speed_mps"]}
        command = {"header": _header(stamp, mission.root), "drive": drive}
        yield Message(stamp, "/ackermann_cmd", command)
        yield Message(stamp, "/mode", {"data": names[int(row["mode"])]})


def _measure(sensor: RecordedSensor, times: Array) -> Iterator[Message]:
    """Yield each reading once, stamped with its sampling time, up to the end of the mission."""
    period = sensor.kind.period_s
    samples = np.floor(times / period + _SAME_TIME)
    samples[-1] = math.ceil(times[-1] / period - _SAME_TIME) - 1
    before = np.concatenate([[-1.0], samples[:-1]])
    for row in np.flatnonzero(samples > before).tolist():
        stamp = to_stamp(float(samples[row]) * period)
        content = _fill_message(sensor.kind, sensor.readings[row].tolist())
        if content is not None:
            if _choose_type(sensor.kind) not in _WITHOUT_HEADER:
                content = {"header": _header(stamp, sensor.link), **content}
            yield Message(stamp, f"/{sensor.link}", content)


def _yaw_rates(rows: pd.DataFrame) -> list[float]:
    time, yaw = rows["time_s"].to_numpy(float), np.unwrap(rows["yaw_rad"].to_numpy(float))
    after, before = (np.clip(np.arange(len(rows)) + i, 0, len(rows) - 1) for i in (1, -1))
    turned, elapsed = yaw[after] - yaw[before], time[after] - time[before]
    rates: list[float] = (turned / np.where(elapsed > 0.0, elapsed, 1.0)).tolist()
    return rates


def _goals(mission: RecordedMission) -> list[Pose]:
    """Return the poses of the waypoints, each facing along the leg that ends there."""
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
        "position": _vector(pose.position),
        "orientation": dict(zip("xyzw", pose.quaternion, strict=True)),
    }


def _list_markers(world: World) -> Iterator[Mapping[str, Any]]:
    for body in standing_obstacles(world):
        colour = FIXED if body.mass is None else _MOVABLE
        rgba = {**dict(zip("rgb", colour, strict=True)), "a": 1.0}
        solids = [shape for shape in body.shapes if shape.kind != "plane"]
        for index, shape in enumerate(solids):
            pose = _pose(body.pose @ shape.pose)
            yield {"ns": body.name, "id": index, **_geometry(shape), "pose": pose, "color": rgba}


def mark_walker(walker: WalkerTrack, record: int) -> Mapping[str, Any]:
    """Return a walker's marker, without header, at one record of its track."""
    x, y = walker.places[record].tolist()
    place = {"position": _vector((x, y, walker.height_m / 2)), "orientation": {"w": 1.0}}
    cylinder = _geometry(Shape("cylinder", (walker.radius_m, walker.height_m)))
    rgba = {**dict(zip("rgb", WALKER, strict=True)), "a": 1.0}
    return {"ns": walker.name, "id": 0, **cylinder, "pose": place, "color": rgba}


def _geometry(shape: Shape) -> Mapping[str, Any]:
    if shape.kind == "convex":
        solid = convex_polyhedron(shape.corners)
        points = solid.corners[solid.triangles.ravel()].tolist()
        scale = _vector((1.0, 1.0, 1.0))
        return {"type": TRIANGLE_LIST, "scale": scale, "points": [_vector(p) for p in points]}
    if shape.kind == "box":
        return {"type": CUBE, "scale": _vector(shape.size)}
    across = 2 * shape.size[0]
    height = shape.size[1] if shape.kind == "cylinder" else across
    kind = CYLINDER if shape.kind == "cylinder" else _SPHERE
    return {"type": kind, "scale": _vector((across, across, height))}


def _vector(values: Any) -> Mapping[str, float]:
    return dict(zip("xyz", values, strict=True))


def _choose_type(kind: Beam | Signal) -> str:
    if isinstance(kind, Beam):
        return SCAN if kind.bearings_deg else RANGE
    return _SIGNALS.get((kind.measures, len(kind.channels)), NUMBERS)


def _fill_message(kind: Beam | Signal, readings: Sequence[float]) -> Content | None:
    """Return the content of a message, without header; None if the sensor is silent."""
    if isinstance(kind, Beam):
        if not any(map(math.isfinite, readings)):
            return None
        return _scan(kind, readings) if kind.bearings_deg else _range(kind, readings[0])
    if not all(map(math.isfinite, readings)):
        return None
    return _signal(_choose_type(kind), readings)


def _range(beam: Beam, reading: float) -> Content:
    return {
        "radiation_type": _RADIATIONS.get(beam.radiation, 0),
        "field_of_view": math.radians(beam.fov_deg),
        "min_range": beam.range_min_m,
        "max_range": beam.range_max_m,
        "range": reading,
    }


def _scan(beam: Beam, ranges: Sequence[float]) -> Content:
    first, last = (math.radians(beam.bearings_deg[end]) for end in (0, -1))
    return {
        "angle_min": first,
        "angle_max": last,
        "angle_increment": (last - first) / (len(ranges) - 1),
        "scan_time": beam.period_s,
        "range_min": beam.range_min_m,
        "range_max": beam.range_max_m,
        "ranges": ranges,
    }


def _signal(type_name: str, values: Sequence[float]) -> Content:
    if type_name == IMU:
        return {
            "orientation_covariance": _NO_ORIENTATION,
            "angular_velocity": _vector(values[:3]),
            "linear_acceleration": _vector(values[3:]),
        }
    if type_name == TWIST:
        return {"twist": {"linear": {"x": values[0]}, "angular": {"z": values[1]}}}
    return {"data": bool(values[0]) if type_name == SWITCH else values}
