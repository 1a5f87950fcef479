"""Worlds that are drawn: fields of obstacles around a course."""
