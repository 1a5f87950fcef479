"""The subcommand ``report``: one HTML page of a study."""
