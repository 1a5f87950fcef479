"""Executors: where missions are computed."""
