"""The subcommand ``report``, which writes one HTML page about a study."""
