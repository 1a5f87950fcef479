"""Observers, which send records of runs to experiment trackers."""
