"""The subcommand ``rerun``: missions and the evolution of a run for the viewer Rerun."""
