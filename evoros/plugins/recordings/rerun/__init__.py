"""The subcommand ``rerun``: missions and a run's evolution for the Rerun viewer."""
