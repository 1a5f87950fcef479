"""Which places should carry a sensor if sensors fail? Exactly, by pairs, and by searches.

Measures every set of the places of ``experiment=redundancy`` without a failure. What fails is then
a weighted sum of these scores. Prints the tables of docs/redundancy.md, and draws
docs/img/redundancy.png. What is already in the folder is not computed again:

    python benchmarks/studies/redundancy.py [folder] [seeds]
"""

import subprocess
import sys
from collections.abc import Callable
from functools import partial
from itertools import product
from pathlib import Path

import drop_out
import numpy as np
import pandas as pd
from redundancy_figure import draw
from redundancy_searches import (
    compare_flown,
    fly_searches,
    run_searches,
    summarize_searches,
)
from scipy.stats import kendalltau
from tabulated import EXPERIMENT, Table, list_places, write_sets

from evoros.analysis.drawing.style import save
from evoros.analysis.statistics.regression import sign_flips
from evoros.analysis.statistics.small_samples import holm, mean_interval
from evoros.base.arrays import Array
from evoros.storage.reading import read_table

RATES = (0.0, 0.1, 0.3, 0.5)
BUDGETS = (1, 2, 3, 4, 6, 8)
MEASURED = ["failure=none", "trials=8", "executor=serial"]
EVALUATIONS = 2  # seeds, each with so many trials
IMAGES = Path(__file__).parents[2] / "docs" / "img"
RESAMPLES = 2000
NUMBERS = ("design", "trial", "progress", "time_s", "time_limit_s")


def measure(folder: Path) -> Table:
    """Return the outcomes of all sets; runs the evaluations that the folder lacks."""
    folder.mkdir(parents=True, exist_ok=True)
    places = list_places()
    write_sets(list(places.values()), folder / "sets.csv")
    for seed in range(EVALUATIONS):
        path = folder / f"sets_{seed}"
        begin = ["evaluate", f"designs={folder / 'sets.csv'}", EXPERIMENT, *MEASURED]
        command = ["resume", f"{path}"]
        if not (path / "missions.csv").exists():
            command = [*begin, f"seed={seed}", f"hydra.run.dir={path}"]
        if not (path / "designs.csv").exists():
            subprocess.run([sys.executable, "-m", "evoros", *command], check=True)
    files = [folder / f"sets_{seed}" / "missions.csv" for seed in range(EVALUATIONS)]
    runs = [read_table(file, NUMBERS) for file in files]
    return Table.read(list(places.values()), runs)


def name_set(members: int, names: list[str]) -> str:
    """Write a set by the headings of its places."""
    return ", ".join(names[i] for i in drop_out.list_members(members)) or "none"


def find_optima(table: Table, names: list[str]) -> pd.DataFrame:
    """Return the best set for each budget and rate, and the gain over one chosen for rate 0.

    ``sure`` is the share of resamples of the trials in which it is the best one. The gain is on
    trials that chose neither: each evaluation in turn, with sets chosen by the others.
    """
    rows, resampled = [], resample(table.scores)
    for rate, budget in product(RATES, BUDGETS):
        expected, samples = (drop_out.drop_out(s, rate) for s in (table.scores, resampled))
        sets = drop_out.within(len(names), budget)
        best = drop_out.find_best(expected.mean(0), budget)
        naive = drop_out.find_best(table.scores.mean(0), budget)
        gains = find_gains(table.scores, rate, budget)
        rows.append(
            {
                "rate": rate,
                "budget": budget,
                "best": name_set(best, names),
                "sensors": best.bit_count(),
                "score": expected[:, best].mean(),
                "sure": np.mean(sets[np.argmax(samples[:, sets], axis=1)] == best),
                "for rate 0": expected[:, naive].mean(),
                "gain": mean_interval(gains).write(),
                "p": sign_flips(gains),
            }
        )
    frame = pd.DataFrame(rows)
    tested = frame.rate > 0
    frame.loc[tested, "p (Holm)"] = holm(frame[tested].p.to_numpy())
    return frame.drop(columns="p")


def find_gains(scores: Array, rate: float, budget: int) -> Array:
    """Return, for each trial, the gain of the set chosen for a rate over one chosen for rate 0."""
    gains = []
    for held in np.split(np.arange(len(scores)), EVALUATIONS):
        chosen_by = np.delete(scores, held, axis=0).mean(0)
        best = drop_out.find_best(drop_out.drop_out(chosen_by, rate), budget)
        naive = drop_out.find_best(chosen_by, budget)
        expected = drop_out.drop_out(scores[held], rate)
        gains.append(expected[:, best] - expected[:, naive])
    return np.concatenate(gains)


def resample(scores: Array) -> Array:
    """Return the mean scores in resamples of the trials, (RESAMPLES, sets)."""
    rng = np.random.default_rng(0)
    counts = rng.multinomial(len(scores), np.full(len(scores), 1 / len(scores)), RESAMPLES)
    return np.asarray(counts @ scores / len(scores))


def make_fits(places: int, budget: int) -> dict[str, Array]:
    """Return the matrices of pairwise approximations by name."""
    fitted = {
        "around no sensor": drop_out.near(places, 0),
        "around all sensors": drop_out.near(places, (1 << places) - 1),
        "fit to the budget": drop_out.within(places, budget),
    }
    return {name: drop_out.make_fit(places, sets) for name, sets in fitted.items()}


def judge_pairs(table: Table) -> pd.DataFrame:
    """Return how pairwise approximations rank the sets within a budget, and what they choose."""
    places, rows = len(table.places), []
    for budget, rate in product(BUDGETS[1:], RATES):
        sets = drop_out.within(places, budget)
        for name, fit in make_fits(places, budget).items():
            expect = partial(drop_out.drop_out, rate=rate)
            row = {"approximation": name, "rate": rate, "budget": budget}
            rows.append(row | judge_ranks(table.scores, expect, fit, sets))
    return pd.DataFrame(rows)


def judge_backups(table: Table) -> pd.DataFrame:
    """Return which places of the robot with all sensors deserve a backup, exactly and by pairs."""
    places, rows = len(table.places), []
    fit = make_fits(places, places)["around all sensors"]
    for rate, budget in product(RATES[1:], BUDGETS[:4]):
        sets = np.append(drop_out.within(places, budget), 0)
        expect = partial(drop_out.back_up, rate=rate)
        truth = expect(table.scores.mean(0))
        row = {"rate": rate, "backups": budget, "without": truth[0], "best": truth[sets].max()}
        rows.append(row | judge_ranks(table.scores, expect, fit, sets))
    return pd.DataFrame(rows)


def judge_ranks(
    scores: Array, expect: Callable[[Array], Array], fit: Array, sets: drop_out.Sets
) -> dict[str, float]:
    """Return Kendall's tau of an approximation and the truth, and the regret of its best set.

    ``share`` is the regret as a share of the range of scores; the interval resamples the trials.
    """
    mean = scores.mean(0)
    truth, approximate = expect(mean)[sets], expect(fit @ mean)[sets]
    resampled = resample(scores)
    regrets = find_regret(expect(resampled)[:, sets], expect(resampled @ fit.T)[:, sets])
    low, high = np.quantile(regrets, [0.025, 0.975])
    regret = float(find_regret(truth[None], approximate[None])[0])
    return {
        "kendall": kendalltau(approximate, truth).statistic,
        "regret": regret,
        "low": low,
        "high": high,
        "share": regret / np.ptp(truth),
    }


def find_regret(truth: Array, approximate: Array) -> Array:
    """Return what each row's choice by the approximation loses to its best set."""
    chosen = np.argmax(approximate, axis=1)
    return np.asarray(truth.max(axis=1) - truth[np.arange(len(truth)), chosen])


def main(folder: Path, seeds: int) -> None:
    """Run what is missing, print the tables and draw the figure."""
    table, names = measure(folder), [name.replace("_", " ") for name in list_places()]
    optima, pairs = find_optima(table, names), judge_pairs(table)
    searches = run_searches(table, folder / "searches.csv", seeds)
    summary = summarize_searches(searches)
    flown = fly_searches(table, folder / "flown", list(list_places()))
    for frame in (optima, pairs, judge_backups(table), summary, compare_flown(searches, flown)):
        print(frame.round(3).to_string(index=False), end="\n\n")
    save(draw(optima, table, searches), IMAGES / "redundancy.png", "png")


if __name__ == "__main__":
    main(
        Path(sys.argv[1]) if len(sys.argv) > 1 else Path("outputs/redundancy"),
        int(sys.argv[2]) if len(sys.argv) > 2 else 60,
    )
