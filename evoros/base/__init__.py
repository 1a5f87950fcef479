"""Basics for all rooms: errors, checks, arrays, random draws, messages, compiled rules."""
