"""The search for the failures that hurt a design most."""
