"""The variables by which numeric libraries learn how many threads to start."""

# The libraries read these when they are imported. NUMBA_NUM_THREADS is not among them, because
# numba refuses to change it in a main process that has already started numba's threads.
ONE_THREAD = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "BLIS_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "NUMEXPR_NUM_THREADS",
)
"""Set to 1 in the environment of each process that computes missions, one a core."""
