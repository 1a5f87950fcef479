"""Failures: which sensors fail in a mission, when and how."""
