"""Scripts that the user's ROS Python runs, from 3.8 on; evoros imports none of them.

They import the standard library and one another; ``messages`` and the graphs also import ROS.
"""
