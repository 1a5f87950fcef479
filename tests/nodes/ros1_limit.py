"""The second of two ROS 1 nodes: limits how fast the yaw rate may change. A timer at 20 Hz."""

import rospy
from geometry_msgs.msg import Twist

rospy.init_node("limiter")
commands = rospy.Publisher("/cmd_vel", Twist, queue_size=10)
wish, sent = Twist(), Twist()


def on_wish(message):
    global wish
    wish = message


def send(_):
    sent.linear.x = wish.linear.x
    sent.angular.z += max(-0.1, min(0.1, wish.angular.z - sent.angular.z))
    commands.publish(sent)


rospy.Subscriber("/wish", Twist, on_wish)
rospy.Timer(rospy.Duration(0.05), send)
rospy.spin()
