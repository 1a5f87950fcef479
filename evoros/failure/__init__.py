"""Failure models: which sensors fail, when and how."""
