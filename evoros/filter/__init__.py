"""Filters: noise, delays and faults between a sensor and the controller."""
