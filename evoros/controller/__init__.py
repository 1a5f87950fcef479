"""Controllers and their layers, which compute commands from readings and poses."""
