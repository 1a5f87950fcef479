"""Allocations: which designs of a generation get how many trials."""
