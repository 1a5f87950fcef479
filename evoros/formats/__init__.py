"""Text files to geometry and back: strict XML and CSV, SDF worlds, URDF robots."""
