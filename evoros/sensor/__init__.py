"""Sensors: their rays or signals, rates and errors."""
