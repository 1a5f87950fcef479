"""Measures of designs, which serve as objectives and descriptors."""
