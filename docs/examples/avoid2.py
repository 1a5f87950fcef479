"""A node of ROS 2 that drives to each waypoint and turns away from obstacles."""

import math

import rclpy
from geometry_msgs.msg import PoseStamped, Twist
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import Range


class Avoid(Node):
    """Turns at a sensor that sees something near, otherwise to the goal."""

    def __init__(self):
        super().__init__("avoid", automatically_declare_parameters_from_overrides=True)
        sensors = self.get_parameter("evoros.sensors").value
        self.yaws = {name: self.get_parameter(f"evoros.{name}.pose").value[3] for name in sensors}
        self.speed = 0.4 * self.get_parameter("evoros.drive.max_speed_mps").value
        self.reach = self.get_parameter("reach").value if self.has_parameter("reach") else 1.5
        self.readings, self.goal = {}, None
        self.commands = self.create_publisher(Twist, "cmd_vel", 10)
        for name in sensors:
            self.create_subscription(Range, name, self.on_range, qos_profile_sensor_data)
        self.create_subscription(PoseStamped, "goal_pose", self.on_goal, 10)
        self.create_subscription(Odometry, "odom", self.on_odometry, 10)

    def on_range(self, message):
        """Keep the reading of a sensor."""
        self.readings[message.header.frame_id] = message.range

    def on_goal(self, message):
        """Keep the next waypoint."""
        self.goal = message.pose.position

    def on_odometry(self, message):
        """Publish a command."""
        if self.goal is None:
            return
        pose = message.pose.pose
        yaw = 2 * math.atan2(pose.orientation.z, pose.orientation.w)
        error = math.atan2(self.goal.y - pose.position.y, self.goal.x - pose.position.x) - yaw
        turn = math.remainder(error, 2 * math.pi)
        near = {name: reading for name, reading in self.readings.items() if reading < self.reach}
        if near:
            turn = -1.0 if self.yaws[min(near, key=near.get)] > 0 else 1.0
        twist = Twist()
        twist.linear.x, twist.angular.z = self.speed, turn
        self.commands.publish(twist)


rclpy.init()
rclpy.spin(Avoid())
