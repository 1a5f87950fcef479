"""The subcommand ``video``, which renders a mission as a video."""
