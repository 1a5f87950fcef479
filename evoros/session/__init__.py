"""Start, resume and replay runs and evaluations, from commands and from Python."""
