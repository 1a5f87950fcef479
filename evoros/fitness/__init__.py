"""Fitness: from the outcomes of a design to one number."""
