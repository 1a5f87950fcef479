"""The command ``python benchmarks/faults``."""

import sys
from pathlib import Path

if __name__ == "__main__":
    sys.path.append(str(Path(__file__).parents[2] / "tests"))  # helpers of runs
    from counting import main

    sys.exit(main(sys.argv[1:]))
