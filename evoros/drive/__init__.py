"""Drives: from a command to what each joint does; one file a kind."""
