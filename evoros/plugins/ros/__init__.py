"""ROS 1 and ROS 2 nodes as controllers."""

from evoros.files.plugins import Plugin

PLUGIN = Plugin(__name__, "ROS 1 and ROS 2 nodes as the controller")
