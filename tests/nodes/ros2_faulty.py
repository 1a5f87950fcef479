"""A node of ROS 2 with a fault, in its twentieth answer or from its start: ros2_faulty.py FAULT"""

import math
import os
import signal
import sys
import time

import rclpy
from geometry_msgs.msg import PointStamped, Twist
from nav_msgs.msg import Odometry
from rclpy.parameter import Parameter
from std_msgs.msg import String

fault = sys.argv[1]
if fault == "no_node":
    time.sleep(1e9)
if fault == "fails":
    raise SystemExit("there is no map")
rclpy.init()
wall_clock = [Parameter("use_sim_time", value=False)] if fault == "wall_clock" else []
node = rclpy.create_node("faulty", parameter_overrides=wall_clock)
commands = node.create_publisher(PointStamped if fault == "point" else Twist, "cmd_vel", 10)
modes = node.create_publisher(String, "mode", 10)
count = 0


def on_odometry(_):
    global count
    count += 1
    twist = Twist()
    twist.linear.x = 0.1
    if fault == "sleeps":
        time.sleep(0.002 * (count % 3))
    if count == 20:
        if fault == "dies":
            os._exit(7)
        if fault == "stops":
            os.kill(os.getpid(), signal.SIGSTOP)
        if fault == "spins":
            while True:
                pass
        if fault == "nan":
            twist.angular.z = math.nan
        if fault == "mode":
            modes.publish(String(data="dancing"))
    commands.publish(twist)


if fault != "deaf":
    node.create_subscription(Odometry, "odom", on_odometry, 10)
if fault == "blocks":
    time.sleep(1e9)
rclpy.spin(node)
