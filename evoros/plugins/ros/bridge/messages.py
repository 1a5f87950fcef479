"""The messages of a mission; their types have the same names in ROS 1 and ROS 2."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from geometry_msgs.msg import Pose, PoseStamped, TransformStamped, TwistStamped
from nav_msgs.msg import Odometry, Path
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu, LaserScan, Range
from std_msgs.msg import Bool, Float64MultiArray

try:  # may not be installed
    from tf2_msgs.msg import TFMessage
except ImportError:
    TFMessage = None

from .conversation import Schedule, Tick, root_link, ros_time

CLOCK, TRANSFORMS = "/clock", "/tf"


class Messages:
    """The topics that this process publishes, and the messages of each tick."""

    def __init__(self, briefing: dict[str, Any], stamp: Callable[[int, int], Any]) -> None:
        """Create the messages; ``stamp`` makes a ROS time from seconds and nanoseconds."""
        options, sensors = briefing["ros"], briefing["sensors"]
        self._topics, self._frame, self._stamp = options["topics"], options["frame"], stamp
        self._base = root_link(options["description"])
        self._schedule = Schedule(sensors)
        self._goal_leg: list[float] | None = None
        pattern = self._topics["range"]
        self._range_topics = [pattern.replace("{sensor}", sensor["name"]) for sensor in sensors]
        self._ranges = [_make_message(sensor) for sensor in sensors]
        self._points = [briefing["home"][:2], *briefing["route"]]

    def kinds(self) -> dict[str, type]:
        """Return the message type of each topic."""
        return {
            **dict(zip(self._range_topics, map(type, self._ranges))),
            self._topics["odometry"]: Odometry,
            self._topics["goal"]: PoseStamped,
            self._topics["route"]: Path,
            CLOCK: Clock,
            **({} if TFMessage is None else {TRANSFORMS: TFMessage}),
        }

    def route(self) -> tuple[str, Any]:
        """Return the topic and message of the route, which is published once."""
        stamp = self._stamp(*ros_time(0.0))
        legs = zip(self._points, self._points[1:])
        poses = [self._goal([*start, *end], stamp) for start, end in legs]
        return self._topics["route"], self._locate(Path(poses=poses), stamp)

    def of(self, tick: Tick) -> Iterator[list[tuple[str, Any]]]:
        """Yield lists of (topic, message) to publish together, in the order of the nodes."""
        stamp = self._stamp(*ros_time(tick.time))
        if tick.leg != self._goal_leg:
            self._goal_leg = tick.leg
            yield [(self._topics["goal"], self._goal(tick.leg, stamp))]
        yield list(self._due_ranges(tick, stamp))
        x, y, yaw, speed, yaw_rate = tick.state[:5]
        if x is not None and y is not None and yaw is not None:
            odometry = self._locate(Odometry(child_frame_id=self._base), stamp)
            odometry.pose.pose = _pose(x, y, yaw)
            odometry.twist.twist.linear.x, odometry.twist.twist.angular.z = speed, yaw_rate
            if TFMessage is not None:
                yield [(TRANSFORMS, TFMessage(transforms=[_transform(odometry)]))]
            yield [(self._topics["odometry"], odometry)]
        yield [(CLOCK, Clock(clock=stamp))]

    def _due_ranges(self, tick: Tick, stamp: Any) -> Iterator[tuple[str, Any]]:
        for index in self._schedule.due(tick.time):
            reading, message = tick.readings[index], self._ranges[index]
            values = reading if isinstance(reading, list) else [reading]
            heard = [value for value in values if value is not None]
            if isinstance(message, LaserScan) and heard:
                message.ranges = [math.nan if value is None else value for value in values]
            elif len(heard) == len(values):
                _fill(message, heard)
            else:
                continue
            if hasattr(message, "header"):
                message.header.stamp = stamp
            yield self._range_topics[index], message

    def _goal(self, leg: list[float], stamp: Any) -> Any:
        from_x, from_y, to_x, to_y = leg
        yaw = math.atan2(to_y - from_y, to_x - from_x)
        return self._locate(PoseStamped(pose=_pose(to_x, to_y, yaw)), stamp)

    def _locate(self, message: Any, stamp: Any) -> Any:
        message.header.stamp, message.header.frame_id = stamp, self._frame
        return message


def _make_message(sensor: dict[str, Any]) -> Any:
    make = _signal if "measures" in sensor else _scan if "bearings_rad" in sensor else _range
    message = make(sensor)
    if hasattr(message, "header"):
        message.header.frame_id = sensor["name"]
    return message


def _range(sensor: dict[str, Any]) -> Any:
    infrared = sensor.get("radiation") == "infrared"
    return Range(
        radiation_type=Range.INFRARED if infrared else Range.ULTRASOUND,
        field_of_view=sensor["field_of_view_rad"],
        min_range=sensor["range_min_m"],
        max_range=sensor["range_max_m"],
    )


def _signal(sensor: dict[str, Any]) -> Any:
    kinds = {6: Imu, 2: TwistStamped, 1: Bool}
    expected = {"motion": 6, "wheels": 2, "contact": 1}
    count = len(sensor["channels"])
    known = expected.get(sensor["measures"]) == count
    message = kinds[count]() if known else Float64MultiArray()
    if isinstance(message, Imu):
        covariance = [0.0] * 9
        covariance[0] = -1.0  # marks the orientation as unknown
        message.orientation_covariance = covariance
    return message


def _fill(message: Any, values: Sequence[float]) -> None:
    numbers = list(map(float, values))
    if isinstance(message, Range):
        message.range = numbers[0]
    elif isinstance(message, Imu):
        turning, felt = message.angular_velocity, message.linear_acceleration
        turning.x, turning.y, turning.z, felt.x, felt.y, felt.z = numbers
    elif isinstance(message, TwistStamped):
        message.twist.linear.x, message.twist.angular.z = numbers
    else:
        message.data = bool(numbers[0]) if isinstance(message, Bool) else numbers


def _scan(sensor: dict[str, Any]) -> Any:
    bearings = sensor["bearings_rad"]
    return LaserScan(
        angle_min=bearings[0],
        angle_max=bearings[-1],
        angle_increment=(bearings[-1] - bearings[0]) / (len(bearings) - 1),
        scan_time=sensor["period_s"],
        range_min=sensor["range_min_m"],
        range_max=sensor["range_max_m"],
    )


def _pose(x: float, y: float, yaw: float) -> Any:
    pose = Pose()
    pose.position.x, pose.position.y = float(x), float(y)  # rclpy misinterprets integers
    pose.orientation.z, pose.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)
    return pose


def _transform(odometry: Any) -> Any:
    pose = odometry.pose.pose
    message = TransformStamped(header=odometry.header, child_frame_id=odometry.child_frame_id)
    message.transform.translation.x = pose.position.x
    message.transform.translation.y = pose.position.y
    message.transform.rotation = pose.orientation
    return message
