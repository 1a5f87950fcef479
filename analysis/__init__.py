"""Figures from run folders: a module a figure, each a plain function from tables to matplotlib."""

SUBCOMMANDS = (
    "overlay",
    "panel",
    "fitness",
    "failure",
    "regions",
    "mission",
    "compare",
    "transfer",
    "strategies",
    "claims",
    "report",
    "replay",
)
"""Each is a module of this package, with what ``command.Subcommand`` says."""
