"""Asks whether navigation spreads eyes and detection concentrates them, as in Tiwary et al. (2025).

Evolves eyes and networks for both tasks, from ten seeds each. Champions are compared with random
designs of the same number of eyes, with the first population of their run, and the tasks with each
other; ten further seeds of navigation answer what the first ten suggest. The script prints the
tables and draws docs/img/eyes.png and docs/img/eyes_tasks.png. Runs that are already in the folder
are not computed again:

    python benchmarks/studies/eyes.py [folder] [seeds] [tasks]
"""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from eyes_figure import draw_designs, draw_tasks
from noise import IMAGES, run_long

import evoros
from evoros.analysis.drawing.style import save
from evoros.analysis.statistics.regression import sign_flips
from evoros.analysis.statistics.small_samples import holm, mean_interval
from evoros.base.rng import generator
from evoros.evolution.experiment import Experiment
from evoros.evolution.trials import Measuring
from evoros.session.rebuilding import rebuild

NAVIGATION, DETECTION, PAID, AGAIN = "navigation", "detection", "paid", "again"
TASKS = {  # and the first with eyes that have a price, and from other seeds
    NAVIGATION: ["experiment=eyes_navigation"],
    DETECTION: ["experiment=eyes_detection"],
    PAID: ["experiment=eyes_navigation", "fitness.price_weight=0.01"],
    AGAIN: ["experiment=eyes_navigation"],
}
FIRST_SEED = {AGAIN: 10}
GENERATIONS = 25
RANDOM_DESIGNS = 300  # for each run, of the number of eyes of its champion
MEASURES = {
    "spread": "spread of places",
    "coverage": "share of all bearings seen",
    "front": "share of the front seen",
}
OTHERS = {"number": "eyes", "zones": "zones of an eye", "field_of_view": "width of an eye [deg]"}


def run_task(folder: Path, task: str, seed: int) -> evoros.Run:
    """Return the run of a task and a seed; start or finish it if necessary."""
    overrides = [*TASKS[task], f"seed={FIRST_SEED.get(task, 0) + seed}"]
    overrides += ["figures=[]", "executor=serial"]
    return run_long(folder / f"{task}_{seed}", overrides, GENERATIONS)


def measure_random(experiment: Experiment, number: int, seed: int) -> dict[str, float]:
    """Return the mean of each measure over random designs of this number of eyes."""
    rng, space, measuring = generator(f"{seed}", "eyes"), experiment.space, Measuring(experiment)
    rows: list[Sequence[float]] = []
    while len(rows) < RANDOM_DESIGNS:
        design = space.decode(rng.random(space.size))
        if len(design.mounts) == number:
            rows.append(measuring.score("", 0, design, 0.0).descriptor)
    return dict(zip(experiment.descriptors, np.mean(rows, axis=0).tolist(), strict=True))


def describe(run: evoros.Run, task: str, seed: int) -> dict[str, object]:
    """Return the row of a run: its champion, random designs, and its first population."""
    table = run.generations
    design = int(run.champion.design.iloc[0])
    champion = table[table.id == design].iloc[-1]
    first = table[table.generation == 0]
    fresh = run.missions[(run.missions.design == design) & (run.missions.purpose == "validation")]
    drawn = measure_random(rebuild(run.path).experiment, int(champion.number), seed)
    row: dict[str, object] = {"task": task, "seed": seed, "completed": fresh.completed.mean()}
    row["collided"] = (fresh.ended == "collision").mean()
    for name in OTHERS:
        row |= {name: champion[name], f"{name}_first": first[name].mean()}
    for name in MEASURES:
        column = f"descriptors.{name}"
        row |= {name: champion[column], f"{name}_first": first[column].mean()}
        row[f"{name}_random"] = drawn[name]
    return row


def compare(table: pd.DataFrame) -> pd.DataFrame:
    """Return the paired comparisons of champions, with one correction for all of them.

    They are few: with ten seeds no p is below 0.002, so that none of 26 could be significant.
    """
    by_task = {
        str(task): rows.set_index("seed") for task, rows in table.groupby("task", sort=False)
    }
    differences = {
        (task, "spread of places", against): part.spread - part[f"spread_{suffix}"]
        for task, part in by_task.items()
        for suffix, against in (("random", "random designs"), ("first", "first population"))
        if task != PAID
    }
    if {NAVIGATION, DETECTION} <= set(by_task):
        navigation, detection = by_task[NAVIGATION], by_task[DETECTION]
        for name, title in ({"spread": "spread of places"} | OTHERS).items():
            difference = (navigation[name] - detection[name]).dropna()
            differences[NAVIGATION, title, DETECTION] = difference
        told = detection.completed - detection.collided
        differences[DETECTION, "narrow object reached", "wide one hit"] = told
    if {NAVIGATION, PAID} <= set(by_task):
        difference = (by_task[PAID].number - by_task[NAVIGATION].number).dropna()
        differences[PAID, "eyes", NAVIGATION] = difference
    values = {key: difference.to_numpy(float) for key, difference in differences.items()}
    p = {key: sign_flips(value) for key, value in values.items()}
    corrected = dict(zip(p, holm([*p.values()]), strict=True))
    rows = []
    for (task, measure, against), value in values.items():
        key = task, measure, against
        row = {"task": task, "measure": measure, "against": against, "n": len(value)}
        rows.append(
            row | {"d": mean_interval(value).write(), "p": p[key], "p (Holm)": corrected[key]}
        )
    return pd.DataFrame(rows)


def summarize(table: pd.DataFrame) -> pd.DataFrame:
    """Return the means of each task with their intervals."""
    rows = []
    for task, part in table.groupby("task", sort=False):
        row: dict[str, Any] = {"task": task, "n": len(part)}
        for name in ("completed", "collided", *OTHERS, *MEASURES):
            row[name] = mean_interval(part[name].to_numpy(float)).write()
        for name in MEASURES:
            row[f"{name}, random"] = mean_interval(part[f"{name}_random"].to_numpy(float)).write()
        rows.append(row)
    return pd.DataFrame(rows).set_index("task").T


def main(folder: Path, seeds: int, tasks: Sequence[str]) -> None:
    runs = {}
    for task in tasks:
        for seed in range(seeds):
            runs[task, seed] = run_task(folder, task, seed)
            print(task, seed, flush=True)
    table = pd.DataFrame([describe(run, *key) for key, run in runs.items()])
    table.to_csv(folder / "eyes.csv", index=False)
    with pd.option_context("display.width", 200, "display.max_columns", None):
        print(table.round(2).to_string(index=False))
        print(summarize(table).to_string())
        for again in (False, True):  # a family of tests, and one that it suggested
            family = table[(table.task == AGAIN) == again]
            print(compare(family).round(3).to_string(index=False))
    if {NAVIGATION, DETECTION} <= set(tasks):
        save(draw_tasks(runs), IMAGES / "eyes_tasks.png", "png")
        save(draw_designs(runs), IMAGES / "eyes.png", "png")


if __name__ == "__main__":
    main(
        Path(sys.argv[1]) if len(sys.argv) > 1 else Path("outputs/eyes"),
        int(sys.argv[2]) if len(sys.argv) > 2 else 10,
        sys.argv[3].split(",") if len(sys.argv) > 3 else [*TASKS],
    )
