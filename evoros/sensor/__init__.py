"""Sensors: what they see, along which rays, how often and how well."""
