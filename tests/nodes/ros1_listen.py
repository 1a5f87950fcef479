"""A node of ROS 1 that writes what it is told as lines of JSON: ros1_listen.py FILE"""

import json
import sys

import rospy
from geometry_msgs.msg import PoseStamped, Twist
from nav_msgs.msg import Odometry, Path
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Range
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage

rospy.init_node("listener")
file = open(sys.argv[1], "w", buffering=1)  # noqa: SIM115 - to the end of the process
commands = rospy.Publisher("/cmd_vel", Twist, queue_size=10)
modes = rospy.Publisher("/mode", String, queue_size=10)
count = 0


def write(kind, *values):
    file.write(json.dumps([kind, *values]) + "\n")


def located(message):
    pose = message.pose
    header = message.header
    return [
        header.stamp.to_nsec(), header.frame_id, pose.position.x, pose.position.y,
        pose.orientation.z, pose.orientation.w,
    ]  # fmt: skip


def on_range(m):
    header = m.header
    limits = [m.radiation_type == Range.ULTRASOUND, m.field_of_view, m.min_range, m.max_range]
    write("range", header.stamp.to_nsec(), header.frame_id, m.range, *limits)


def on_odometry(m):
    global count
    twist = m.twist.twist
    write("odometry", m.child_frame_id, twist.linear.x, twist.angular.z, m.pose.pose.position.x)
    count += 1
    if count == 3:
        modes.publish("avoiding")
    commands.publish(Twist())


def on_transforms(m):
    for transform in m.transforms:
        place = transform.transform.translation
        write("tf", transform.header.frame_id, transform.child_frame_id, place.x, place.y)


write("parameters", {name: rospy.get_param(name) for name in rospy.get_param_names()})
for i in range(6):
    rospy.Subscriber(f"/sonar/sonar_{i}", Range, on_range)
rospy.Subscriber("/odom", Odometry, on_odometry)
rospy.Subscriber("/tf", TFMessage, on_transforms)
rospy.Subscriber("/clock", Clock, lambda m: write("clock", m.clock.to_nsec()))
rospy.Subscriber("/move_base_simple/goal", PoseStamped, lambda m: write("goal", *located(m)))
rospy.Subscriber("/route", Path, lambda m: write("route", *map(located, m.poses)))
rospy.spin()
