"""Failure models, which determine the parts that fail, when and how."""
