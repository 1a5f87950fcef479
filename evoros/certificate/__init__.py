"""Confirms, validates and chooses champions."""
