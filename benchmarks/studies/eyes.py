"""Evolves eyes for two tasks, and asks whether navigation spreads them and detection does not."""
import sys
from pathlib import Path

from noise import run_long

TASKS = ("navigation", "detection")
GENERATIONS = 25

if __name__ == "__main__":
    folder = Path(sys.argv[1])
    for task in sys.argv[3].split(","):
        for seed in range(int(sys.argv[2])):
            overrides = [f"experiment=eyes_{task}", f"seed={seed}", "figures=[]", "executor=serial"]
            run = run_long(folder / f"{task}_{seed}", overrides, GENERATIONS)
            print(task, seed, run.path, flush=True)
