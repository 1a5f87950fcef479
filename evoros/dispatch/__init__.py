"""Hands missions to workers."""
