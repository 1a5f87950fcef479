"""Compilation of rules and loops to machine code by numba."""
