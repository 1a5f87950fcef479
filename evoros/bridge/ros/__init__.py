"""Scripts that a user's ROS Python runs; evoros itself imports none of them."""
