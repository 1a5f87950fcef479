"""The subcommands that draw figures."""
