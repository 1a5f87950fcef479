"""Executors: where calls of functions, such as missions, run."""
