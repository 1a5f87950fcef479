"""Filters, which add noise, delays and faults to the signals of sensors and controllers."""
