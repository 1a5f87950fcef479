"""Controllers and their layers, which compute a command from readings and a pose."""
