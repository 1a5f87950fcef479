"""Drives, which convert a command to the motion of a robot's wheels."""
