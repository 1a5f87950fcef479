"""The messages and parameters with which a mission appears in the graph of ROS 1.

Runs in the user's ROS Python.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import genpy
import rospy
from geometry_msgs.msg import Pose, PoseStamped, TransformStamped
from nav_msgs.msg import Odometry, Path
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Range

try:  # often, but not always installed beside rospy
    from tf2_msgs.msg import TFMessage
except ImportError:
    TFMessage = None

if TYPE_CHECKING:
    from evoros.bridge.ros.conversation import Schedule, Tick, root_link, ros_time
else:
    from conversation import Schedule, root_link, ros_time

LARGEST_SEED = 2**31
"""Parameters are 32 bits with a sign."""


def parameters(briefing: dict[str, Any]) -> dict[str, object]:
    """Return the parameters of a mission, by their full names."""
    told = ("sensors", "drive", "home", "route", "acceptance_m", "time_limit_s", "period_s")
    own = {f"/{name}": value for name, value in briefing["parameters"].items()}
    return {
        **own,
        "/use_sim_time": True,
        "/robot_description": briefing["ros"]["description"],
        "/evoros": {
            **{name: briefing[name] for name in told},
            "seed": briefing["seed"] % LARGEST_SEED,
        },
    }


class Outgoing:
    """What this process publishes: its publishers, and the messages of a tick."""

    def __init__(self, briefing: dict[str, Any]) -> None:
        options = briefing["ros"]
        topics, self._frame = options["topics"], options["frame"]
        self._base = root_link(options["description"])
        sensors = briefing["sensors"]
        self._schedule = Schedule(sensors)
        self._goal_leg: list[float] | None = None
        self._ranges = [_range(sensor) for sensor in sensors]
        self._range_publishers = [
            _publisher(topics["range"].format(sensor=sensor["name"]), Range) for sensor in sensors
        ]
        self._odometry = _publisher(topics["odometry"], Odometry)
        self._transform = None if TFMessage is None else _publisher("/tf", TFMessage)
        self._goal = _publisher(topics["goal"], PoseStamped, latch=True)
        self._route = _publisher(topics["route"], Path, latch=True)
        self._clock = _publisher("/clock", Clock)
        self._route.publish(self._path(briefing["home"], briefing["route"]))

    def publishers(self) -> list[Any]:
        """Return all publishers."""
        others = [self._odometry, self._transform, self._goal, self._route, self._clock]
        return self._range_publishers + [each for each in others if each is not None]

    def messages(self, tick: Tick) -> Iterator[tuple[Any, Any]]:
        """Yield publishers and messages in the order in which the nodes shall get them."""
        stamp = genpy.Time(*ros_time(tick.time))
        if tick.leg != self._goal_leg:
            self._goal_leg = tick.leg
            yield self._goal, self._goal_of(tick.leg, stamp)
        for number in self._schedule.due(tick.time):
            reading = tick.readings[number]
            if reading is not None:
                message = self._ranges[number]
                message.header.stamp, message.range = stamp, reading
                yield self._range_publishers[number], message
        x, y, yaw, speed, yaw_rate = tick.state[:5]
        if x is not None and y is not None and yaw is not None:
            odometry = self._locate(Odometry(child_frame_id=self._base), stamp)
            odometry.pose.pose = _pose(x, y, yaw)
            odometry.twist.twist.linear.x, odometry.twist.twist.angular.z = speed, yaw_rate
            if self._transform is not None:
                yield self._transform, TFMessage([_transform(odometry)])
            yield self._odometry, odometry
        yield self._clock, Clock(stamp)

    def _goal_of(self, leg: list[float], stamp: Any) -> Any:
        """Return the end of a leg; the pose looks along the leg."""
        from_x, from_y, to_x, to_y = leg
        yaw = math.atan2(to_y - from_y, to_x - from_x)
        return self._locate(PoseStamped(pose=_pose(to_x, to_y, yaw)), stamp)

    def _path(self, home: list[float], route: list[list[float]]) -> Any:
        stamp = genpy.Time(*ros_time(0.0))
        points = [home[:2], *route]
        poses = [self._goal_of([*start, *goal], stamp) for start, goal in zip(points, route)]
        return self._locate(Path(poses=poses), stamp)

    def _locate(self, message: Any, stamp: Any) -> Any:
        message.header.stamp, message.header.frame_id = stamp, self._frame
        return message


def _publisher(topic: str, kind: type, latch: bool = False) -> Any:
    """Create a publisher that sends at once, not by the thread of a queue as rospy advises."""
    warnings.filterwarnings("ignore", "The publisher should be created", SyntaxWarning)
    return rospy.Publisher(topic, kind, queue_size=None, tcp_nodelay=True, latch=latch)


def _range(sensor: dict[str, Any]) -> Any:
    message = Range(
        radiation_type=Range.ULTRASOUND,
        field_of_view=sensor["field_of_view_rad"],
        min_range=sensor["range_min_m"],
        max_range=sensor["range_max_m"],
    )
    message.header.frame_id = sensor["name"]
    return message


def _pose(x: float, y: float, yaw: float) -> Any:
    pose = Pose()
    pose.position.x, pose.position.y = x, y
    pose.orientation.z, pose.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)
    return pose


def _transform(odometry: Any) -> Any:
    pose = odometry.pose.pose
    message = TransformStamped(header=odometry.header, child_frame_id=odometry.child_frame_id)
    message.transform.translation.x = pose.position.x
    message.transform.translation.y = pose.position.y
    message.transform.rotation = pose.orientation
    return message
