"""Observers, which send the records of runs to experiment trackers."""
