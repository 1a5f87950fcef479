"""Reads robot descriptions in URDF and xacro, and merges fixed links."""
