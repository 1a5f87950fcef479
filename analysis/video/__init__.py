"""A mission as a video."""
