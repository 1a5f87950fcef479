"""Fitness functions, which score designs by the outcomes of missions."""
