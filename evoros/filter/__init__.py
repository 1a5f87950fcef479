"""Filters: noise, delay, faults. They stand between a source of values and the controller."""
