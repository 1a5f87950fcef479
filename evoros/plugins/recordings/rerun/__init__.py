"""The subcommand ``rerun``, which exports missions and a run's evolution to the Rerun viewer."""
