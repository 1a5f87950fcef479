"""Scripts for the user's ROS Python (3.8 or later), which evoros itself does not import.

They import only the standard library and one another; ``messages`` and the graphs also import ROS.
"""
