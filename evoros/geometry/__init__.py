"""Shapes and distances between shapes, independent of files, robots and worlds."""
