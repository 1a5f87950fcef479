"""The second of two ROS 2 nodes: limits how fast the yaw rate may change, at each odometry."""

import rclpy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry

rclpy.init()
node = rclpy.create_node("limiter")
commands = node.create_publisher(Twist, "cmd_vel", 10)
wish, sent = Twist(), Twist()


def on_wish(message):
    global wish
    wish = message


def send(_):
    sent.linear.x = wish.linear.x
    sent.angular.z += max(-0.1, min(0.1, wish.angular.z - sent.angular.z))
    commands.publish(sent)


node.create_subscription(Odometry, "odom", send, 10)
node.create_subscription(Twist, "wish", on_wish, 10)
rclpy.spin(node)
