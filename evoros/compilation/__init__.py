"""Compiles rules and loops to machine code with numba."""
