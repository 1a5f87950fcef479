"""Controllers and their layers: from readings and a pose to a command."""
