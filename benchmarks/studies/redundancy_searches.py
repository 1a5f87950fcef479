"""Searches for the best set of places, with their missions looked up, and simpler answers."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import drop_out
import numpy as np
import pandas as pd
from noise import FINAL
from tabulated import EXPERIMENT, BudgetSpent, Table, Tabulated

import evoros
from evoros.analysis.statistics.small_samples import (
    holm,
    mean_interval,
    share_interval,
)
from evoros.analysis.statistics.two_samples import a12, brunner_munzel
from evoros.base.arrays import Array
from evoros.evolution.loop import evolve
from evoros.executor.protocol import Pool

BUDGET = 600  # missions
SENSORS = 4  # maximum number of sensors of a design
FROM_START = ["failure.earliest_s=0.0", "failure.latest_s=0.0"]
RATE = 0.3
FAILURES: dict[str, tuple[list[str], Callable[[Array], Array]]] = {
    "drop-out, 30 %": (
        ["failure=independent", f"failure.probability={RATE}"],
        lambda scores: drop_out.drop_out(scores, RATE),
    ),
    "one at random": (["failure=random", *FROM_START], drop_out.fail_one),
    "the worst one": (
        [
            *("failure=adversarial", *FROM_START),
            *("failure.validation.earliest_s=0.0", "failure.validation.latest_s=0.0"),
        ],
        drop_out.fail_worst,
    ),
}
CHECKED, CHECKS = "GA", 15  # the search whose missions are also run, and its seeds
BASELINE, PAIRS, ALL = "random search", "by pairs", "all sets"
SEARCHES = {
    BASELINE: ["optimizer=random_search"],
    "GA": ["optimizer=ga"],
    "GA, lifelong": ["optimizer=ga", "allocation=lifelong"],
    "CatCMA": ["optimizer=cat_cma"],
}
COMMON = [
    *("figures=[]", "record=none", "executor=serial"),
    "optimizer.validation_trials=0",
]
MOST_GENERATIONS = 1000
Row = dict[str, object]


def run_searches(table: Table, file: Path, seeds: int) -> pd.DataFrame:
    """Return a row for each answer, failure and seed; computes those that the file lacks."""
    rows = pd.read_csv(file) if file.exists() else pd.DataFrame({"failure": [], "search": []})
    for failure, name in product(FAILURES, [*SEARCHES, PAIRS, ALL]):
        done = (rows.failure == failure) & (rows.search == name)
        missing = sorted(set(range(seeds)) - set(rows[done].seed if done.any() else ()))
        if name in SEARCHES:
            new = search(table, failure, name, missing)
        else:
            new = [choose_from(table, failure, name, seed) for seed in missing]
        if new:
            rows = pd.concat([rows, pd.DataFrame(new)] if len(rows) else [pd.DataFrame(new)])
            rows.to_csv(file, index=False)
            print(failure, name, flush=True)
    return rows


def search(table: Table, failure: str, name: str, seeds: Sequence[int]) -> list[Row]:
    """Run a search with each seed, without and with a final choice, at equal missions."""
    overrides = [EXPERIMENT, *SEARCHES[name], *FAILURES[failure][0], *COMMON]
    experiment: Any = evoros.compose(overrides).build()
    rows = []
    with experiment.executor.open() as pool:  # it runs no mission, because the journal has all
        for seed in seeds:
            seeded = replace(experiment, seed=seed)
            steps = follow(seeded, table, pool)
            rows.append(judge(table, failure, name, seed, steps))
            searched = BUDGET - FINAL.finalists * 5 * len(experiment.world)
            generations = sum(missions <= searched for missions, _ in steps)
            final = Tabulated(experiment, table)
            chosen = replace(seeded, final_choice=FINAL)
            evolve(chosen, final, final, generations, pool)
            end = [(len(final.needed), table.find_number(final.champions[-1].design))]
            rows.append(judge(table, failure, f"{name}, final choice", seed, end))
    return rows


def follow(experiment: Any, table: Table, pool: Pool) -> list[tuple[int, int]]:
    """Run a search until its missions exceed the budget; return its steps within."""
    journal = Tabulated(experiment, table, BUDGET)
    with suppress(BudgetSpent):
        evolve(experiment, journal, journal, MOST_GENERATIONS, pool)
    return journal.steps


def fly_searches(table: Table, folder: Path, names: Sequence[str]) -> pd.DataFrame:
    """Return rows of searches whose missions are run, to compare with those looked up."""
    failure = next(iter(FAILURES))
    rows = [fly(table, failure, CHECKED, seed, folder, names) for seed in range(CHECKS)]
    return pd.DataFrame(rows)


def fly(
    table: Table, failure: str, name: str, seed: int, folder: Path, names: Sequence[str]
) -> Row:
    """Run a search, unless the folder has it, and return its row."""
    overrides = [EXPERIMENT, *SEARCHES[name], *FAILURES[failure][0], *COMMON, f"seed={seed}"]
    path = folder / f"{name}_{seed}"
    if not (path / "missions.csv").exists():
        evoros.run([*overrides, "optimizer.generations=12"], path)
    elif evoros.load_run(path).status["state"] != "finished":
        evoros.resume(path)
    run = evoros.load_run(path)
    missions: Any = run.missions.groupby("generation").size().cumsum()
    if missions.iloc[-1] <= BUDGET:
        raise RuntimeError(f"{path}: more generations are needed for {BUDGET} missions")
    steps = []
    groups: Any = run.generations.groupby("generation")
    for generation, candidates in groups:
        best = candidates.loc[candidates.fitness.idxmax()]
        regions = {best[f"sensor{i}_region"] for i in range(SENSORS)}
        number = sum(1 << i for i, place in enumerate(names) if place in regions)
        steps.append((int(missions[generation]), number))
    return judge(table, failure, name, seed, [step for step in steps if step[0] <= BUDGET])


def choose_from(table: Table, failure: str, name: str, seed: int) -> Row:
    """Choose by some trials of few sets without a failure, which cost as much as a search.

    By pairs: of the sets of at most two sensors, from which the others are approximated. All sets:
    of each set within the budget, from which the expectation is exact.
    """
    places = len(table.places)
    measured = np.append(0, drop_out.within(places, 2 if name == PAIRS else SENSORS))
    worlds = sorted({world for _, world in table.outcomes})
    trials = BUDGET // (len(worlds) * len(measured))
    chosen = np.random.default_rng(seed).integers(table.trials, size=trials)
    scores = table.scores[chosen].mean(0)
    if name == PAIRS:
        scores = drop_out.make_fit(places, measured) @ scores
    best = drop_out.find_best(FAILURES[failure][1](scores), SENSORS)
    return judge(table, failure, name, seed, [(trials * len(worlds) * len(measured), best)])


def judge(table: Table, failure: str, name: str, seed: int, steps: list[tuple[int, int]]) -> Row:
    """Return the row of a search, from its missions and best set after each generation."""
    expected = FAILURES[failure][1](table.scores.mean(0))
    optimum = drop_out.find_best(expected, SENSORS)
    missions, members = steps[-1]
    wrong = [count for count, best in steps if best != optimum]
    later = [count for count, _ in steps if count > max(wrong, default=0)]
    return {
        "failure": failure,
        "search": name,
        "seed": seed,
        "missions": missions,
        "set": members,
        "regret": expected[optimum] - expected[members],
        "found": members == optimum,
        "to optimum": min(later, default=np.nan),
    }


def summarize_searches(rows: pd.DataFrame) -> pd.DataFrame:
    """Return shares and means with intervals, and tests against random search, Holm over all."""
    groups: dict[Any, pd.DataFrame] = dict(iter(rows.groupby(["failure", "search"], sort=False)))
    regrets = {key: group.regret.to_numpy() for key, group in groups.items()}
    others = [key for key in groups if key[1] != BASELINE]
    tests = [brunner_munzel(regrets[key], regrets[key[0], BASELINE]) for key in others]
    p = dict(zip(others, holm(tests), strict=True))
    return pd.DataFrame(
        {
            "failure": key[0],
            "search": key[1],
            "n": len(group),
            "missions": group.missions.mean(),
            "found": share_interval(int(group.found.sum()), len(group)).write(),
            "to optimum": group["to optimum"].median() if group.found.any() else np.nan,
            "regret": mean_interval(regrets[key]).write(),
            "p (Holm)": p.get(key, np.nan),
            "A12": a12(-regrets[key], -regrets[key[0], BASELINE]),
        }
        for key, group in groups.items()
    )


def compare_flown(rows: pd.DataFrame, flown: pd.DataFrame) -> pd.DataFrame:
    """Compare the regrets of a search whose missions were run with those looked up."""
    like = rows[(rows.failure == flown.failure.iloc[0]) & (rows.search == CHECKED)]
    regrets = [frame.regret.to_numpy() for frame in (flown, like)]
    return pd.DataFrame(
        {
            "search": CHECKED,
            "missions": ["run", "looked up"],
            "n": list(map(len, regrets)),
            "regret": [mean_interval(values).write() for values in regrets],
            "p": brunner_munzel(*regrets),
        }
    )
