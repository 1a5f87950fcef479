"""Decides whether a design meets what is required of it."""
