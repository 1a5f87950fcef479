"""Compares all searches on the tasks of docs/benchmark.md, and checks the runs of others.

A task is an experiment with a budget of missions. A search gets as many generations as fit into it,
with its defaults otherwise. Each champion is scored on 100 fresh trials, which are the same for
all. Runs and scores that are in the folder are not computed again:

    python benchmarks/studies/searches.py study [folder] [seeds]
    python benchmarks/studies/searches.py check RUN ...

``study`` prints the table of docs/benchmark.md and draws docs/img/benchmark.png. ``check`` prints a
row for each run folder, or why it cannot have one.
"""

import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml
from matplotlib.figure import Figure

import evoros
from evoros.analysis.drawing.style import COLUMN_IN, save, use_style
from evoros.analysis.statistics.small_samples import a12, holm, mann_whitney, median_interval
from evoros.config.compose import compose
from evoros.mission.plan import VALIDATION
from evoros.session.given_designs import read_given

BUDGETS = {  # missions of the search, without the validation
    "benchmark_boxes": 600,
    "benchmark_maze": 600,
    "benchmark_blocks": 600,
    "benchmark_dense": 900,
}
BASELINE = "random_search"
SEARCHES = {
    BASELINE: "random search",
    "sobol": "Sobol'",
    "ga": "GA",
    "cma_es": "CMA-ES",
    "cat_cma": "CatCMA",
    "tpe": "TPE",
    "map_elites": "MAP-Elites",
    "cma_mae": "CMA-MAE",
    "nsga2": "NSGA-II",
}
GIVEN = ("robot", "design", "world", "course", "failure", "controller", "simulator", "fitness")
"""The values that the task defines; all others are free."""
SCORING = ["trials=100", "seed=2026", "executor=serial"]
CHEAP = ["optimizer.validation_trials=0", "figures=[]", "record=none", "executor=serial"]
IMAGES = Path(__file__).parents[2] / "docs" / "img"


def count_missions(run: evoros.Run) -> int:
    """Return the missions that the search, the confirmation and a final choice needed."""
    return int((run.missions.purpose != VALIDATION).sum())


def search(task: str, optimizer: str, seed: int, folder: Path) -> evoros.Run:
    """Return the run of a search in the folder, of as many generations as fit into the budget."""
    overrides = [f"experiment={task}", f"optimizer={optimizer}", f"seed={seed}", *CHEAP]
    values: Any = compose(overrides).values
    most = values["optimizer"]["population_size"] * values["trials"] * len(values["world"])
    generations = BUDGETS[task] // most
    if (folder / "status.json").exists():
        run = evoros.resume(folder)
    else:
        run = evoros.run([*overrides, f"optimizer.generations={generations}"], folder)
    # A search that asks for fewer than its population in a generation gets more of them.
    while (further := (BUDGETS[task] - count_missions(run)) // most) > 0:
        generations = int(run.generations.generation.max()) + 1 + further
        run = evoros.resume(folder, [f"optimizer.generations={generations}"])
    return run


def check(run: evoros.Run) -> dict[str, object]:
    """Return the row of a finished run.

    Raises:
        SystemExit: it is not a run of a task, or it is beyond the budget.
    """
    recorded = yaml.safe_load((run.path / "config.yaml").read_text())
    differences = {task: list(_find_differences(task, recorded)) for task in BUDGETS}
    task, differing = min(differences.items(), key=lambda item: len(item[1]))
    if differing:
        raise SystemExit(
            f"{run.path}: must have the configuration of a task, and differs from {task} in "
            f"{', '.join(differing)}; leave these as experiment={task} has them"
        )
    missions = count_missions(run)
    if missions > BUDGETS[task] or run.status["state"] != "finished":
        raise SystemExit(
            f"{run.path}: must be finished, with at most {BUDGETS[task]} missions that are not of "
            f"the validation, and is {run.status['state']}, with {missions}; lower the generations"
        )
    with evoros.Evaluator([f"experiment={task}", *SCORING]) as evaluator:
        champion = read_given([str(run.path)], evaluator.experiment)[0].design
        scores = evaluator.evaluate([champion])
    return {
        "task": task.removeprefix("benchmark_"),
        "search": recorded["optimizer"]["_target_"].split(".")[-2],
        "seed": recorded["seed"],
        "missions": missions,
        "validated": float(scores.fitness_mean.iloc[0]),
        "completed": float(scores.filter(like="_completed").mean(axis=1).iloc[0]),
    }


def _find_differences(task: str, recorded: dict[str, Any]) -> Iterator[str]:
    expected = yaml.safe_load(compose([f"experiment={task}"]).text)
    return (key for key in GIVEN if recorded.get(key) != expected.get(key))


def study_one(task: str, optimizer: str, seed: int, folder: Path) -> dict[str, object]:
    """Return the row of a search with a seed."""
    return check(search(task, optimizer, seed, folder / f"{task}_{optimizer}_{seed}"))


def study(folder: Path, seeds: int) -> pd.DataFrame:
    """Return all rows; computes those that ``searches.csv`` lacks, two at a time, and adds them."""
    folder.mkdir(parents=True, exist_ok=True)
    file, columns = folder / "searches.csv", ["task", "search", "seed"]
    table = pd.read_csv(file) if file.exists() else pd.DataFrame({name: [] for name in columns})
    done = set(table[columns].itertuples(index=False, name=None))
    wanted = [(t, s, seed) for seed in range(seeds) for t in BUDGETS for s in SEARCHES]
    wanted = [job for job in wanted if (job[0].removeprefix("benchmark_"), *job[1:]) not in done]
    with ProcessPoolExecutor(2) as pool:
        for row in pool.map(study_one, *zip(*wanted, strict=True), [folder] * len(wanted)):
            table = pd.concat([table, pd.DataFrame([row])] if len(table) else [pd.DataFrame([row])])
            table.to_csv(file, index=False)
            print(row, flush=True)
    return table


def summarize(table: pd.DataFrame) -> pd.DataFrame:
    """Return medians with bootstrap intervals, and tests against random search in each task."""
    rows = []
    for task, of_task in table.groupby("task", sort=False):
        scores = {name: runs.validated.to_numpy() for name, runs in of_task.groupby("search")}
        others = [name for name in SEARCHES if name != BASELINE and name in scores]
        p = holm([mann_whitney(scores[name], scores[BASELINE]) for name in others])
        corrected = dict(zip(others, p, strict=True))
        for name in (BASELINE, *others):
            runs, interval = of_task[of_task.search == name], median_interval(scores[name])
            rows.append(
                {
                    "task": task,
                    "search": name,
                    "n": len(runs),
                    "missions": runs.missions.mean(),
                    "validated": runs.validated.median(),
                    "low": interval.low,
                    "high": interval.high,
                    "worst": runs.validated.min(),
                    "completed": runs.completed.median(),
                    "p (Holm)": corrected.get(name, np.nan),
                    "A12": a12(scores[name], scores[BASELINE]),
                }
            )
    return pd.DataFrame(rows)


def draw(table: pd.DataFrame) -> Figure:
    """Draw the validated fitness of the champions of each search, a panel for each task."""
    summary, colour = summarize(table), "#0072b2"
    names = list(dict.fromkeys(summary.search))
    with use_style():
        whole = Figure(figsize=(2 * COLUMN_IN, 0.85 * COLUMN_IN), layout="constrained")
        tasks = list(dict.fromkeys(summary.task))
        panels = np.atleast_1d(whole.subplots(1, len(tasks), sharey=True))
        for axes, task in zip(panels, tasks, strict=True):
            rows: Any = summary[summary.task == task]
            y = np.array([len(names) - 1 - names.index(name) for name in rows.search])
            for place, name in zip(y, rows.search, strict=True):
                dots = table[(table.task == task) & (table.search == name)].validated
                axes.plot(dots, np.full(len(dots), place), "o", c=colour, ms=2.6, alpha=0.5, mew=0)
            axes.hlines(y, rows.low, rows.high, color=colour, lw=1.4)
            axes.plot(rows.validated, y, "o", c=colour, ms=4.5)
            axes.axvline(rows.validated.iloc[0], color="0.6", lw=0.7, ls=":", zorder=0)
            axes.set_title(task)
            axes.spines[["top", "right"]].set_visible(False)
        panels[0].set_yticks(range(len(names)), [SEARCHES[name] for name in names[::-1]])
        whole.supxlabel("fitness (Eq. 1), validated on 100 fresh trials", fontsize="medium")
    return whole


def main(command: str, arguments: Sequence[str]) -> None:
    """Run the study, or check run folders."""
    if command == "check":
        rows = [check(evoros.load_run(folder)) for folder in arguments]
        print(pd.DataFrame(rows).round(3).to_string(index=False))
        return
    folder = Path(arguments[0]) if arguments else Path("outputs/searches")
    table = study(folder, int(arguments[1]) if len(arguments) > 1 else 5)
    print(summarize(table).round(3).to_string(index=False))
    save(draw(table), IMAGES / "benchmark.png", "png")


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "study", sys.argv[2:])
