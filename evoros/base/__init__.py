"""Basics of every room: errors, checks, arrays, random draws, messages, compiled rules."""
