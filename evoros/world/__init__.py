"""Worlds: bodies on the ground and a course between them."""
