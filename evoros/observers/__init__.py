"""Observers: trackers of experiments, which get what runs record. Optional."""
