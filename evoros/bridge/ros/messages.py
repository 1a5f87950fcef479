"""The messages of a mission, which ROS 1 and ROS 2 name alike.

Runs in the user's ROS Python.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

from geometry_msgs.msg import Pose, PoseStamped, TransformStamped, TwistStamped
from nav_msgs.msg import Odometry, Path
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu, LaserScan, Range
from std_msgs.msg import Bool, Float64MultiArray

try:  # often, but not always installed
    from tf2_msgs.msg import TFMessage
except ImportError:
    TFMessage = None

from .conversation import Schedule, Tick, root_link, ros_time

CLOCK, TRANSFORMS = "/clock", "/tf"


class Messages:
    """The topics on which this process publishes, and the messages of each tick."""

    def __init__(self, briefing: dict[str, Any], stamp: Callable[[int, int], Any]) -> None:
        """``stamp`` makes a time of seconds and nanoseconds."""
        options, sensors = briefing["ros"], briefing["sensors"]
        self._topics, self._frame, self._stamp = options["topics"], options["frame"], stamp
        self._base = root_link(options["description"])
        self._schedule = Schedule(sensors)
        self._goal_leg: list[float] | None = None
        pattern = self._topics["range"]
        self._range_topics = [pattern.replace("{sensor}", sensor["name"]) for sensor in sensors]
        self._ranges = [_range(sensor) for sensor in sensors]
        self._points = [briefing["home"][:2], *briefing["route"]]

    def kinds(self) -> dict[str, type]:
        """Return the kind of the messages of each topic."""
        return {
            **dict(zip(self._range_topics, map(type, self._ranges))),
            self._topics["odometry"]: Odometry,
            self._topics["goal"]: PoseStamped,
            self._topics["route"]: Path,
            CLOCK: Clock,
            **({} if TFMessage is None else {TRANSFORMS: TFMessage}),
        }

    def route(self) -> tuple[str, Any]:
        """Return topic and message of the route, which is published once."""
        stamp = self._stamp(*ros_time(0.0))
        legs = zip(self._points, self._points[1:])
        poses = [self._goal([*start, *end], stamp) for start, end in legs]
        return self._topics["route"], self._locate(Path(poses=poses), stamp)

    def of(self, tick: Tick) -> Iterator[list[tuple[str, Any]]]:
        """Yield topics and messages in the order in which the nodes shall get them.

        The messages of one list belong together: the ranges of a tick.
        """
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
            fill = _FILLS.get(type(message))
            if fill is not None:
                told = reading if isinstance(reading, list) else [reading]
                values = [value for value in told if value is not None]
                if len(values) < len(told):
                    continue
                fill(message, values)
            elif isinstance(reading, list):
                if all(value is None for value in reading):
                    continue
                message.ranges = [math.nan if value is None else value for value in reading]
            elif reading is None:
                continue
            else:
                message.range = float(reading)
            if hasattr(message, "header"):
                message.header.stamp = stamp
            yield self._range_topics[index], message

    def _goal(self, leg: list[float], stamp: Any) -> Any:
        """Return the end of a leg; the pose looks along the leg."""
        from_x, from_y, to_x, to_y = leg
        yaw = math.atan2(to_y - from_y, to_x - from_x)
        return self._locate(PoseStamped(pose=_pose(to_x, to_y, yaw)), stamp)

    def _locate(self, message: Any, stamp: Any) -> Any:
        message.header.stamp, message.header.frame_id = stamp, self._frame
        return message


def _range(sensor: dict[str, Any]) -> Any:
    """Return the message of a sensor: its signal's, its range's, or a scan from the right on."""
    if "measures" in sensor:
        return _signal(sensor)
    if "bearings_rad" in sensor:
        return _scan(sensor)
    infrared = sensor.get("radiation") == "infrared"
    message = Range(
        radiation_type=Range.INFRARED if infrared else Range.ULTRASOUND,
        field_of_view=sensor["field_of_view_rad"],
        min_range=sensor["range_min_m"],
        max_range=sensor["range_max_m"],
    )
    message.header.frame_id = sensor["name"]
    return message


def _signal(sensor: dict[str, Any]) -> Any:
    """Return the message of an IMU, of odometry, of a bumper, or of any other sensor."""
    kinds = {6: Imu, 2: TwistStamped, 1: Bool}
    expected = {"motion": 6, "wheels": 2, "contact": 1}
    count = len(sensor["channels"])
    known = expected.get(sensor["measures"]) == count
    message = kinds[count]() if known else Float64MultiArray()
    if isinstance(message, Imu):
        covariance = [0.0] * 9
        covariance[0] = -1.0  # which says that there is no orientation
        message.orientation_covariance = covariance
    if hasattr(message, "header"):
        message.header.frame_id = sensor["name"]
    return message


def _fill_imu(message: Any, values: list[float]) -> None:
    turning, felt = message.angular_velocity, message.linear_acceleration
    turning.x, turning.y, turning.z = map(float, values[:3])
    felt.x, felt.y, felt.z = map(float, values[3:])


def _fill_twist(message: Any, values: list[float]) -> None:
    message.twist.linear.x, message.twist.angular.z = map(float, values)


def _fill_switch(message: Any, values: list[float]) -> None:
    message.data = bool(values[0])


def _fill_numbers(message: Any, values: list[float]) -> None:
    message.data = list(map(float, values))


_FILLS: dict[type, Callable[[Any, list[float]], None]] = {
    Imu: _fill_imu,
    TwistStamped: _fill_twist,
    Bool: _fill_switch,
    Float64MultiArray: _fill_numbers,
}


def _scan(sensor: dict[str, Any]) -> Any:
    bearings = sensor["bearings_rad"]
    message = LaserScan(
        angle_min=bearings[0],
        angle_max=bearings[-1],
        angle_increment=(bearings[-1] - bearings[0]) / (len(bearings) - 1),
        scan_time=sensor["period_s"],
        range_min=sensor["range_min_m"],
        range_max=sensor["range_max_m"],
    )
    message.header.frame_id = sensor["name"]
    return message


def _pose(x: float, y: float, yaw: float) -> Any:
    pose = Pose()
    pose.position.x, pose.position.y = float(x), float(y)  # rclpy misreads whole numbers
    pose.orientation.z, pose.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)
    return pose


def _transform(odometry: Any) -> Any:
    pose = odometry.pose.pose
    message = TransformStamped(header=odometry.header, child_frame_id=odometry.child_frame_id)
    message.transform.translation.x = pose.position.x
    message.transform.translation.y = pose.position.y
    message.transform.rotation = pose.orientation
    return message
