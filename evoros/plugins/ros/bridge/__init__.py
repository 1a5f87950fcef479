"""Scripts for the user's ROS Python (3.8 or later); evoros imports none of them.

They import the standard library and one another; ``messages`` and the graphs also import ROS.
"""
