"""Runs a mission of a design in a world, with random faults and noise."""
