"""Designs: what evolves, and where it may lie."""
