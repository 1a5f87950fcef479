"""Executors, which run functions in parallel, for example missions."""
