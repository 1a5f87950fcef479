"""Shapes and the distances between them, independent of files, robots and worlds."""
