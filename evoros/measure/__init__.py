"""Measures of designs, used as objectives and descriptors."""
