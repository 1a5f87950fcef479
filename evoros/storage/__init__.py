"""Writes, reads and verifies run folders."""
