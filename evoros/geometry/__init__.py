"""Shapes and the distances between them; knows no file, no robot and no world."""
