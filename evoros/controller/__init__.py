"""Controllers and their layers, which turn readings and a pose into a command."""
