"""Drives, which convert commands to wheel motion."""
