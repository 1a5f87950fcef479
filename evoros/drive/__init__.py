"""Drives: from a command to the wheels of a robot."""
