"""Walkers: people who walk through a world and avoid each other and the robots."""
