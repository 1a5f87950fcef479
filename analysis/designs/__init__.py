"""Measures of sensor designs: coverage, clusters, differences from random designs."""
