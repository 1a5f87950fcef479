"""The figures: one module for each subcommand that draws one."""
