"""Optimizers: what is asked to be evaluated, and what becomes of it."""
