"""Sensors, with rays or signals, rates, noise and errors."""
