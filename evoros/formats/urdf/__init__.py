"""Reads URDF and xacro robot descriptions, and merges fixed links."""
