"""Optimizers: search the unit cube by ask and tell."""
