"""A search for the failures that degrade a design most."""
