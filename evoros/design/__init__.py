"""Designs: the sensors and values that evolve, with their ranges."""
