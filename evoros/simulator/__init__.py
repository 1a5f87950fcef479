"""Simulators: robots in a world, step by step."""
