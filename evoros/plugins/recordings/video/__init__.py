"""The subcommand ``video``: a mission as a video."""
