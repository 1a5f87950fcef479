"""The command ``python benchmarks/coverage``."""

import os
import sys

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy; the processes are the threads

from covering import main

if __name__ == "__main__":
    sys.exit(main())
