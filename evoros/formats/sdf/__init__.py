"""Readers and writers of SDF worlds."""
