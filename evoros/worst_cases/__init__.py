"""Searches the failures that hurt a design most."""
