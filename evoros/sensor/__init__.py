"""Sensors: their rays or signals, rates, noise and errors."""
