"""Compares searches on the tasks of the leaderboard, at an equal budget of missions.

Each search has its defaults, as many generations as fit the budget, and the final choice of its
task. What is already in the folder is not computed again:

    python benchmarks/studies/searches.py [folder] [seeds]

The script runs what is missing, one run at a time, writes ``benchmarks/leaderboard.csv``, prints
the tables of docs/benchmark.md and draws docs/img/benchmark.png.
"""

from collections.abc import Iterator
from pathlib import Path

import evoros

BASELINE = "random_search"
SEARCHES = {  # name, and generations that fit the budget beside a final choice of 50 missions
    BASELINE: ("random search", 15),
    "sobol": ("Sobol'", 15),
    "set_cover": ("set cover, GA", 16),
    "ga": ("GA", 16),
    "cma_es": ("CMA-ES", 15),
    "cat_cma": ("CatCMA", 15),
}
TASKS = {  # the name of each, and what a task needs besides the defaults of a search
    "network": {},
    "priced": {"set_cover": ["optimizer.width_deg=90"]},
    "boxes": {},
}
QUICK = ["executor=serial", "figures=[]", "record=none"]
ROOT = Path(__file__).parents[2]
HAND_MADE = {"network": ["controller=rover"], "priced": ["controller=rover"], "boxes": []}
"""Fans of three pairs of sonars, with the hand-made controller."""
FAN = "design,sensor,x_m,y_m,yaw_deg\n" + "\n".join(
    f"fan,sonar,{x},{sign * y},{sign * yaw}"
    for x, y, yaw in ((0.24, 0.05, 15), (0.22, 0.12, 45), (0.15, 0.14, 75))
    for sign in (1, -1)
)


def list_jobs(seeds: int) -> Iterator[tuple[str, str, int]]:
    """Yield the task, the search and the seed of each run, task by task."""
    for task in TASKS:
        for seed in range(seeds):
            yield from ((task, search, seed) for search in SEARCHES)


def search_once(task: str, search: str, seed: int, folder: Path) -> None:
    """Run a search, unless the folder has it."""
    path = folder / f"{task}_{search}_{seed}"
    if (path / "status.json").exists():
        if evoros.load_run(path).status["state"] != "finished":
            evoros.resume(path)
        return
    chosen = [f"experiment=benchmark_{task}", f"optimizer={search}", f"seed={seed}"]
    generations = f"optimizer.generations={SEARCHES[search][1]}"
    evoros.run([*chosen, generations, *TASKS[task].get(search, []), *QUICK], path)
