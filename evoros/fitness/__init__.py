"""Fitness functions, which score a design by the outcomes of its missions."""
