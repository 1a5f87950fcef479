"""Basics for all packages: errors, checks, arrays, random numbers, messages, compiled rules."""
