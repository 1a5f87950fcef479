"""A plain node of ROS 2, as users write them: ros2_avoid.py callback|each_range|rate|timer"""

import sys
import threading

import rclpy
from avoid import Avoider
from geometry_msgs.msg import PoseStamped, Twist
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import Range

style = sys.argv[1]


class Avoid(Node):
    def __init__(self):
        super().__init__("avoider", automatically_declare_parameters_from_overrides=True)
        names = self.value("evoros.sensors")
        self.avoider = Avoider(
            {name: self.value(f"evoros.{name}.pose")[3] for name in names},
            self.value("evoros.drive.steering_limit_rad"),
            self.value("evoros.drive.wheelbase_m"),
            self.get_parameter_or("reach", rclpy.Parameter("reach", value=2.0)).value,
        )
        self.commands = self.create_publisher(Twist, "cmd_vel", 10)
        for name in names:  # best effort, as drivers of sensors publish
            self.create_subscription(Range, name, self.on_range, qos_profile_sensor_data)
        self.create_subscription(Odometry, "odom", self.on_odometry, 10)
        self.create_subscription(PoseStamped, "goal_pose", self.on_goal, 10)
        if style == "timer":
            self.create_timer(0.1, self.command)

    def value(self, name):
        return self.get_parameter(name).value

    def command(self):
        decision = self.avoider.decide()
        if decision is not None:
            twist = Twist()
            twist.linear.x, twist.angular.z = decision
            self.commands.publish(twist)

    def on_range(self, message):
        self.avoider.hear_range(message.header.frame_id, message.range)
        if style == "each_range":
            self.command()

    def on_odometry(self, message):
        pose = message.pose.pose
        self.avoider.hear_pose(
            pose.position.x, pose.position.y, pose.orientation.z, pose.orientation.w
        )
        if style == "callback":
            self.command()

    def on_goal(self, message):
        self.avoider.hear_goal(message.pose.position.x, message.pose.position.y)


rclpy.init()
node = Avoid()
if style == "rate":
    threading.Thread(target=rclpy.spin, args=(node,), daemon=True).start()
    rate = node.create_rate(10)
    while rclpy.ok():
        node.command()
        rate.sleep()
rclpy.spin(node)
