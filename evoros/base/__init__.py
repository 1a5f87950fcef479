"""Basics for all packages: errors, checks, arrays, random draws, messages, compiled rules."""
