"""Tables of runs and evaluations, read from their folders."""
