"""Measures of designs: objectives and descriptors."""
