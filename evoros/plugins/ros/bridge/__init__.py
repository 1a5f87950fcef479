"""Scripts for the user's ROS Python (3.8 or later), without packages outside ROS."""
