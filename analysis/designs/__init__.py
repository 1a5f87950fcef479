"""Measures of sensor designs: coverage, clusters, and differences from random designs."""
