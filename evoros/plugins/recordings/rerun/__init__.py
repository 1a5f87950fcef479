"""The subcommand ``rerun``, which exports missions and the evolution to the Rerun viewer."""
