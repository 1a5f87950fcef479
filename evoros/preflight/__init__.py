"""Checks input and settings before a run."""
