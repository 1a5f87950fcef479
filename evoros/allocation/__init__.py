"""Allocations, which distribute trials among the designs of a generation."""
