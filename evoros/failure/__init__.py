"""Failure models: the parts that fail, when and how."""
