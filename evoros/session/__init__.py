"""Runs and evaluations: started, resumed, replayed, from commands and from Python."""
