"""A node of ROS 1 that commands by AckermannDriveStamped."""

import rospy
from ackermann_msgs.msg import AckermannDriveStamped
from nav_msgs.msg import Odometry

rospy.init_node("driver")
commands = rospy.Publisher("/cmd_vel", AckermannDriveStamped, queue_size=10)
drive = AckermannDriveStamped()
drive.drive.speed, drive.drive.steering_angle = 0.25, -0.125
rospy.Subscriber("/odom", Odometry, lambda _: commands.publish(drive))
rospy.spin()
