"""Environment variables that limit the threads of numeric libraries."""

# The libraries read these on import. NUMBA_NUM_THREADS is left out, because numba refuses to change
# it in a main process that has already started numba's threads.
ONE_THREAD = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "BLIS_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "NUMEXPR_NUM_THREADS",
)
"""Variables set to 1 in each process that computes missions, because there is one per core."""
