"""The subcommand ``rerun``: export missions and a run's evolution to the Rerun viewer."""
