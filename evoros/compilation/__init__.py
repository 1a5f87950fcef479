"""Rules and loops as machine code, by numba."""
