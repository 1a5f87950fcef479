"""Scripts for the user's ROS Python (3.8 or later); they import ROS and the standard library."""
