"""Starts, resumes and replays runs and evaluations, from commands and from Python."""
