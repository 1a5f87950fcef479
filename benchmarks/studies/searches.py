"""Compares searches on the tasks of the leaderboard, at an equal budget of missions.

Each search has its defaults, as many generations as fit the budget, and a final choice of ten
finalists. What is already in the folder is not computed again:

    python benchmarks/studies/searches.py [folder] [seeds] [task ...]

The script runs what is missing, one run at a time, writes ``benchmarks/leaderboard.csv``, prints
the tables of docs/benchmark.md and draws docs/img/benchmark.png.
"""

import sys
from collections.abc import Iterable, Iterator, Sequence
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

import evoros
from evoros.analysis.drawing.style import COLUMN_IN, save, use_style
from evoros.analysis.statistics.factorial import contrast_interval
from evoros.analysis.statistics.small_samples import holm, median_interval
from evoros.analysis.statistics.two_samples import a12_interval, brunner_munzel
from evoros.design.design import Design
from evoros.plugins.leaderboard.rows import make_row, read_rows, write_rows
from evoros.sensor.protocol import Mount

SEARCHES = {
    "random_search": "random search",
    "sobol": "Sobol'",
    "set_cover": "set cover, GA",
    "ga": "GA",
    "cma_es": "CMA-ES",
}
BUDGET = ["optimizer.generations=13", "final_choice.finalists=10"]
"""Fit all tasks: 16 designs in a generation, of the genetic algorithm 14 on average."""
COVERED = "optimizer.failed=0"  # if no sensor fails, none is needed twice
TASKS: dict[str, dict[str, list[str]]] = {  # the name of each, and what a search needs there
    "network": {"set_cover": [COVERED]},
    "priced": {"set_cover": [COVERED, "optimizer.width_deg=180"]},  # that of the network's view
    "boxes": {},
}
QUICK = ["executor=serial", "figures=[]", "record=none"]
ROOT = Path(__file__).parents[2]
HAND_MADE = ((0.24, 0.05, 15.0), (0.22, 0.12, 45.0), (0.15, 0.14, 75.0))
"""x, y [m] and yaw [deg] of the left sonars of a fan, whose hand-made controller is ``rover``."""
SEED = 2026  # of the trials of the hand-made design


def list_jobs(seeds: int, tasks: Sequence[str]) -> Iterator[tuple[str, str, int]]:
    """Yield the task, the search and the seed of each run, task by task."""
    for task in tasks:
        for seed in range(seeds):
            yield from ((task, search, seed) for search in SEARCHES)


def search_once(task: str, search: str, seed: int, folder: Path) -> None:
    """Run a search, unless the folder has it."""
    path = folder / f"{task}_{search}_{seed}"
    if (path / "status.json").exists():
        if evoros.load_run(path).status["state"] != "finished":
            evoros.resume(path)
        return
    chosen = [f"experiment=benchmark_{task}", f"optimizer={search}", f"seed={seed}", *BUDGET]
    evoros.run([*chosen, *TASKS[task].get(search, []), *QUICK], path)


def read_runs(folder: Path, jobs: Iterable[tuple[str, str, int]]) -> pd.DataFrame:
    """Return the rows of runs, and write them into the leaderboard beside those of others."""
    rows = [make_row(folder / "_".join(map(str, job))) for job in jobs]
    file, ours = ROOT / "benchmarks" / "leaderboard.csv", {row.name for row in rows}
    others = [row for row in read_rows(file) if row.name not in ours]
    file.write_text(write_rows(sorted([*rows, *others], key=lambda row: row.name)))
    numbers = ["missions", "fitness", "low", "high", "completed"]
    return pd.DataFrame(rows).astype(dict.fromkeys(numbers, float))


def score_hand_made(task: str) -> tuple[float, float]:
    """Return the fitness and the share of completed trials of the fan in a task."""
    overrides = [f"experiment=benchmark_{task}", "design=six_sonars", "controller=rover"]
    with evoros.Evaluator([*overrides, "trials=30", f"seed={SEED}", *QUICK]) as evaluator:
        robot = evaluator.experiment.robot
        mounts = [
            Mount("sonar", robot.mount_link, x, sign * y, robot.mount_z_m, sign * yaw, 12.5)
            for x, y, yaw in HAND_MADE
            for sign in (1, -1)
        ]
        (row,) = evaluator.evaluate([Design(tuple(mounts))]).to_dict("records")
    completed = [value for name, value in row.items() if str(name).endswith("_completed")]
    return float(row["fitness_mean"]), float(np.mean(completed))


def summarize(table: pd.DataFrame) -> pd.DataFrame:
    """Return the median of each search in each task, and how many missions it needed."""
    rows = []
    for (task, search), runs in table.groupby(["task", "search"], sort=False):
        middle = median_interval(runs.fitness.to_numpy())
        rows.append(
            {
                "task": task,
                "search": search,
                "n": len(runs),
                "missions": runs.missions.mean(),
                "median": middle.value,
                "low": middle.low,
                "high": middle.high,
                "worst": runs.fitness.min(),
                "best": runs.fitness.max(),
                "completed": runs.completed.mean(),
            }
        )
    return pd.DataFrame(rows)


def compare(table: pd.DataFrame) -> pd.DataFrame:
    """Compare all pairs of searches in each task; Holm's correction is over all of them."""
    rows = []
    for task, runs in table.groupby("task", sort=False):
        scores = {name: runs.fitness[runs.search == name].to_numpy() for name in SEARCHES}
        for one, other in combinations(SEARCHES, 2):
            x, y = scores[other], scores[one]
            gain, effect = contrast_interval([x, y], [1, -1]), a12_interval(x, y)
            rows.append(
                {
                    "task": task,
                    "search": other,
                    "against": one,
                    "gain": gain.write(),
                    "A12": effect.write(),
                    "p": brunner_munzel(x, y),
                }
            )
    result = pd.DataFrame(rows)
    result["p (Holm)"] = holm(result.p.to_numpy())
    return result


def draw(table: pd.DataFrame, hand_made: dict[str, float]) -> Figure:
    """Draw the fitness of all champions, with medians and intervals, a panel for each task."""
    summary, colour, names = summarize(table), "#0072b2", list(SEARCHES)
    with use_style():
        tasks = list(dict.fromkeys(summary.task))
        whole = Figure(figsize=(2 * COLUMN_IN, 0.75 * COLUMN_IN), layout="constrained")
        panels = np.atleast_1d(whole.subplots(1, len(tasks), sharey=True))
        for axes, task in zip(panels, tasks, strict=True):
            rows: Any = summary[summary.task == task]
            y = np.array([len(names) - 1 - names.index(name) for name in rows.search])
            for place, name in zip(y, rows.search, strict=True):
                dots = table[(table.task == task) & (table.search == name)].fitness
                spread = place - 0.22 + 0.1 * np.linspace(-1, 1, len(dots))
                axes.plot(dots, spread, "o", c=colour, ms=2.4, alpha=0.45, mew=0)
            axes.hlines(y, rows.low, rows.high, color=colour, lw=1.6)
            axes.plot(rows["median"], y, "o", c=colour, ms=4.5)
            axes.axvline(hand_made[task], color="#d55e00", lw=0.9, ls="--", zorder=0)
            left = hand_made[task] > np.mean(axes.get_xlim())  # where there is space
            axes.annotate(
                "hand-made",
                (hand_made[task], 1.0),
                (-3 if left else 3, -2),
                xycoords=("data", "axes fraction"),
                textcoords="offset points",
                ha="right" if left else "left",
                va="top",
                color="#d55e00",
                fontsize="small",
            )
            axes.set_title(task)
            axes.spines[["top", "right"]].set_visible(False)
        panels[0].set_yticks(range(len(names)), [SEARCHES[name] for name in names[::-1]])
        whole.supxlabel("fitness of the champion on 30 fresh trials", fontsize="medium")
    return whole


def main(folder: Path, seeds: int, tasks: Sequence[str]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    jobs = list(list_jobs(seeds, tasks))
    for job in jobs:
        search_once(*job, folder)
    table = read_runs(folder, jobs)
    hand_made = {task: score_hand_made(task) for task in tasks}
    print(summarize(table).round(3).to_string(index=False))
    print(compare(table).round(5).to_string(index=False))
    print("hand-made fan (fitness, share completed):", hand_made)
    fitness = {task: fitness for task, (fitness, _) in hand_made.items()}
    save(draw(table, fitness), ROOT / "docs" / "img" / "benchmark.png", "png")


if __name__ == "__main__":
    main(
        Path(sys.argv[1]) if len(sys.argv) > 1 else Path("outputs/searches"),
        int(sys.argv[2]) if len(sys.argv) > 2 else 15,
        sys.argv[3:] or list(TASKS),
    )
