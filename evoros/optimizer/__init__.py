"""Optimizers, which search the unit cube by ask and tell."""
