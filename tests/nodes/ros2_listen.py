"""A node of ROS 2 that writes what it is told as lines of JSON: ros2_listen.py FILE

It subscribes to the sonars from the last to the first.
"""

import json
import sys

import rclpy
from geometry_msgs.msg import PoseStamped, Twist
from nav_msgs.msg import Odometry, Path
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Range
from std_msgs.msg import String

rclpy.init()
node = rclpy.create_node("listener", automatically_declare_parameters_from_overrides=True)
file = open(sys.argv[1], "w", buffering=1)  # noqa: SIM115 - to the end of the process
commands = node.create_publisher(Twist, "cmd_vel", 10)
modes = node.create_publisher(String, "mode", 10)
kept = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
count = 0


def write(kind, *values):
    file.write(json.dumps([kind, *values]) + "\n")


def nanoseconds(time):
    return 10**9 * time.sec + time.nanosec


def located(message):
    pose, header = message.pose, message.header
    point, turn = pose.position, pose.orientation
    return [nanoseconds(header.stamp), header.frame_id, point.x, point.y, turn.z, turn.w]


def on_range(m):
    limits = [m.radiation_type == Range.ULTRASOUND, m.field_of_view, m.min_range, m.max_range]
    write("range", nanoseconds(m.header.stamp), m.header.frame_id, m.range, *limits)


def on_odometry(m):
    global count
    twist = m.twist.twist
    write("odometry", m.child_frame_id, twist.linear.x, twist.angular.z, m.pose.pose.position.x)
    count += 1
    if count == 3:
        modes.publish(String(data="avoiding"))
    commands.publish(Twist())


write("parameters", {name: p.value for name, p in node.get_parameters_by_prefix("").items()})
for i in reversed(range(6)):
    node.create_subscription(Range, f"sonar/sonar_{i}", on_range, 10)
node.create_subscription(Odometry, "odom", on_odometry, 10)
node.create_subscription(Clock, "clock", lambda m: write("clock", nanoseconds(m.clock)), 10)
node.create_subscription(PoseStamped, "goal_pose", lambda m: write("goal", *located(m)), kept)
node.create_subscription(Path, "route", lambda m: write("route", *map(located, m.poses)), 10)
rclpy.spin(node)
