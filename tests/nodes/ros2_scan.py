"""A node of ROS 2 that drives by a scan and writes what it hears: ros2_scan.py FILE"""

import json
import sys

import rclpy
from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.qos import qos_profile_sensor_data
from scan import steer
from sensor_msgs.msg import Imu, LaserScan, Range
from std_msgs.msg import Bool

rclpy.init()
node = rclpy.create_node("driver", automatically_declare_parameters_from_overrides=True)
file = open(sys.argv[1], "w", buffering=1)  # noqa: SIM115 - to the end of the process
commands = node.create_publisher(Twist, "cmd_vel", 10)
heard = {}


def on_scan(m):
    angles = [m.angle_min, m.angle_max, m.angle_increment, m.range_min, m.range_max, m.scan_time]
    heard["lidar"] = [m.header.frame_id, *angles, list(m.ranges)]


def on_imu(m):
    turning, felt = m.angular_velocity, m.linear_acceleration
    values = [turning.x, turning.y, turning.z, felt.x, felt.y, felt.z]
    heard["imu"] = [m.header.frame_id, m.orientation_covariance[0], values]


def on_wheels(m):
    heard["odometry"] = [m.header.frame_id, m.twist.linear.x, m.twist.angular.z]


def on_range(m):
    heard["infrared"] = [m.header.frame_id, m.radiation_type == Range.INFRARED, m.range]


def on_touch(m):
    heard["bumper"] = m.data


def on_odometry(m):
    """The last message of a step: decide."""
    file.write(json.dumps(heard) + "\n")
    if "lidar" in heard:
        twist = Twist()
        twist.linear.x, twist.angular.z = steer(heard["lidar"][-1], heard["bumper"])
        commands.publish(twist)
    heard.clear()


KINDS = {
    "lidar": (LaserScan, on_scan),
    "imu": (Imu, on_imu),
    "odometry": (TwistStamped, on_wheels),
    "infrared": (Range, on_range),
    "bumper": (Bool, on_touch),
}
for name in node.get_parameter("evoros.sensors").value:
    kind, on_message = KINDS[node.get_parameter(f"evoros.{name}.type").value]
    node.create_subscription(kind, name, on_message, qos_profile_sensor_data)
node.create_subscription(Odometry, "odom", on_odometry, 10)
rclpy.spin(node)
