"""The subcommand ``replay``: a mission as a video."""
