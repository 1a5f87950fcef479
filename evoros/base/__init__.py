"""Basics for all packages: errors, checks, arrays, random draws, messages and compiled rules."""
