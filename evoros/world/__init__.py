"""Worlds: bodies on level ground, and the course among them."""
