"""Designs: the sensors and values that evolve, and their ranges."""
