"""A plain node of ROS 1: ros1_avoid.py callback|each_range|rate|timer [TOPIC]"""

import sys

import rospy
from avoid import Avoider
from geometry_msgs.msg import PoseStamped, Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Range

style, topic = sys.argv[1], (sys.argv[2:] or ["/cmd_vel"])[0]
rospy.init_node("avoider", anonymous=True)
sensors = rospy.get_param("/evoros/sensors")
drive = rospy.get_param("/evoros/drive")
avoider = Avoider(
    {sensor["name"]: sensor["pose"][3] for sensor in sensors},
    drive["steering_limit_rad"],
    drive["wheelbase_m"],
    rospy.get_param("~reach", rospy.get_param("/reach", 2.0)),
)
commands = rospy.Publisher(topic, Twist, queue_size=10)


def command(*_):
    decision = avoider.decide()
    if decision is not None:
        twist = Twist()
        twist.linear.x, twist.angular.z = decision
        commands.publish(twist)


def on_range(message):
    avoider.hear_range(message.header.frame_id, message.range)
    if style == "each_range":
        command()


def on_odometry(message):
    pose = message.pose.pose
    avoider.hear_pose(pose.position.x, pose.position.y, pose.orientation.z, pose.orientation.w)
    if style == "callback":
        command()


def on_goal(message):
    avoider.hear_goal(message.pose.position.x, message.pose.position.y)


for sensor in sensors:
    rospy.Subscriber("/" + sensor["name"], Range, on_range)
rospy.Subscriber("/odom", Odometry, on_odometry)
rospy.Subscriber("/move_base_simple/goal", PoseStamped, on_goal)
if style == "timer":
    rospy.Timer(rospy.Duration(0.1), command)
if style == "rate":
    rate = rospy.Rate(10)
    while not rospy.is_shutdown():
        command()
        rate.sleep()
rospy.spin()
