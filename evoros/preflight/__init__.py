"""Finds bad input and doubtful settings before a run."""
