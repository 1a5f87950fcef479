"""Bundled files, durable writing, and the origin of this copy of evoros."""
