"""Conversion between text files and geometry: strict XML and CSV, SDF worlds, URDF robots."""
