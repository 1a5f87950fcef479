"""Executors, which run calls of functions, such as missions."""
