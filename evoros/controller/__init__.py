"""Controllers and their layers: one class a file."""
