"""Optimizers, which search the unit cube through an ask-and-tell interface."""
