"""Worlds: bodies on the ground, and a course among them."""
