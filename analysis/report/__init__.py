"""The subcommand ``report``, which writes a single HTML page about a study."""
