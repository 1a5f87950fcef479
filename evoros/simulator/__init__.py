"""Simulators, which move robots in a world step by step."""
