"""A node of ROS 1 with a fault, in its twentieth answer or from its start: ros1_faulty.py FAULT"""

import ctypes
import math
import os
import signal
import sys
import time

import rospy
from geometry_msgs.msg import PointStamped, Twist
from nav_msgs.msg import Odometry
from std_msgs.msg import String

fault = sys.argv[1]
if fault == "no_node":
    time.sleep(1e9)
if fault == "fails":
    raise SystemExit("there is no map")
rospy.init_node("faulty", anonymous=True)
commands = rospy.Publisher("/cmd_vel", PointStamped if fault == "point" else Twist, queue_size=10)
modes = rospy.Publisher("/mode", String, queue_size=10)
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
        if fault == "hides":
            ctypes.CDLL(None).prctl(4, 0, 0, 0, 0)  # PR_SET_DUMPABLE
        if fault == "nan":
            twist.angular.z = math.nan
        if fault == "infinite":
            twist.angular.z = math.inf
        if fault == "mode":
            modes.publish("dancing")
        if fault == "closes":
            commands.unregister()
            return
    commands.publish(twist)


if fault != "deaf":
    rospy.Subscriber("/odom", Odometry, on_odometry)
rospy.spin()
