"""Allocations, which choose the number of trials for each design of a generation."""
