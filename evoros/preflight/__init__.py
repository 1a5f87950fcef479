"""Checks the input and settings of a run before it starts."""
