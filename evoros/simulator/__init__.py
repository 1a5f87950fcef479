"""Simulators: one robot in one world, step by step."""
