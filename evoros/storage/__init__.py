"""Writing, reading and verification of run folders."""
