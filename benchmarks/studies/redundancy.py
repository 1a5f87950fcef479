"""Which places should carry a sensor if sensors fail? Exactly, by pairs, and by searches.

Measures every set of the places of ``experiment=redundancy`` without a failure. What fails is then
a weighted sum of these scores. Prints the tables of docs/redundancy.md, and draws
docs/img/redundancy.png. What is already in the folder is not computed again:

    python benchmarks/studies/redundancy.py [folder] [seeds]
"""

import subprocess
import sys
from itertools import product
from pathlib import Path

import drop_out
import numpy as np
import pandas as pd
from redundancy_figure import draw
from redundancy_searches import run_searches, summarize_searches
from scipy.stats import kendalltau
from tabulated import EXPERIMENT, Table, list_places, write_sets

from evoros.analysis.drawing.style import save
from evoros.analysis.statistics.small_samples import mean_interval
from evoros.base.arrays import Array
from evoros.storage.reading import read_table

RATES = (0.0, 0.1, 0.3, 0.5)
BUDGETS = (1, 2, 3, 4, 6, 8)
MEASURED = ["failure=none", "trials=8", "executor=serial"]
EVALUATIONS = 4  # seeds, each with so many trials
IMAGES = Path(__file__).parents[2] / "docs" / "img"
RESAMPLES = 4000
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
    """Return the best set for each budget and rate, and what is lost without a thought of failure.

    ``sure`` is the share of resamples of the trials in which it is the best one.
    """
    scores, rows = table.scores.mean(0), []
    resampled = resample(table.scores)
    for rate in RATES:
        expected, samples = drop_out.drop_out(scores, rate), spread(resampled, rate)
        for budget in BUDGETS:
            members = drop_out.find_best(expected, budget)
            naive = drop_out.find_best(scores, budget)
            sets = drop_out.within(len(names), budget)
            of_trials = spread(table.scores, rate)
            lost = mean_interval(of_trials[:, members] - of_trials[:, naive])
            rows.append(
                {
                    "rate": rate,
                    "budget": budget,
                    "best": name_set(members, names),
                    "sensors": members.bit_count(),
                    "score": expected[members],
                    "sure": np.mean(sets[np.argmax(samples[:, sets], axis=1)] == members),
                    "for rate 0": expected[naive],
                    "lost": lost.write(),
                }
            )
    return pd.DataFrame(rows)


def resample(scores: Array) -> Array:
    """Return the mean scores in resamples of the trials, (RESAMPLES, sets)."""
    rng = np.random.default_rng(0)
    counts = rng.multinomial(len(scores), np.full(len(scores), 1 / len(scores)), RESAMPLES)
    return np.asarray(counts @ scores / len(scores))


def spread(scores: Array, rate: float) -> Array:
    """Return the expected scores of each row of scores."""
    return np.array([drop_out.drop_out(row, rate) for row in scores])


def make_fits(places: int, budget: int) -> dict[str, Array]:
    """Return the matrices of pairwise approximations by name."""
    fitted = {
        "around no sensor": drop_out.near(places, 0),
        "around all sensors": drop_out.near(places, (1 << places) - 1),
        "fit to the budget": drop_out.within(places, budget),
    }
    return {name: drop_out.make_fit(places, sets) for name, sets in fitted.items()}


def judge_pairs(table: Table) -> pd.DataFrame:
    """Return how pairwise approximations rank the sets within a budget, and what they choose.

    ``share`` is the regret as a share of the range of scores within the budget.
    """
    scores, places, rows = table.scores.mean(0), len(table.places), []
    resampled = resample(table.scores)[:500]
    for budget in BUDGETS[1:]:
        sets = drop_out.within(places, budget)
        for (name, fit), rate in product(make_fits(places, budget).items(), RATES):
            truth = drop_out.drop_out(scores, rate)
            approximate = drop_out.drop_out(fit @ scores, rate)
            samples = spread(resampled, rate), spread(resampled @ fit.T, rate)
            low, high = np.quantile(find_regret(*samples, sets), [0.025, 0.975])
            regret = float(find_regret(truth[None], approximate[None], sets)[0])
            rows.append(
                {
                    "approximation": name,
                    "rate": rate,
                    "budget": budget,
                    "kendall": kendalltau(approximate[sets], truth[sets]).statistic,
                    "regret": regret,
                    "low": low,
                    "high": high,
                    "share": regret / np.ptp(truth[sets]),
                }
            )
    return pd.DataFrame(rows)


def find_regret(truth: Array, approximate: Array, sets: drop_out.Sets) -> Array:
    """Return what each row's choice by the approximation loses to its best set."""
    chosen = sets[np.argmax(approximate[:, sets], axis=1)]
    return np.asarray(truth[:, sets].max(axis=1) - truth[np.arange(len(truth)), chosen])


def judge_backups(table: Table) -> pd.DataFrame:
    """Return which places of the robot with all sensors deserve a backup, exactly and by pairs."""
    scores, places, rows = table.scores.mean(0), len(table.places), []
    fit = make_fits(places, places)["around all sensors"]
    for rate, budget in product(RATES[1:], BUDGETS[1:4]):
        truth, approximate = (drop_out.back_up(s, rate) for s in (scores, fit @ scores))
        sets = np.append(drop_out.within(places, budget), 0)
        rows.append(
            {
                "rate": rate,
                "budget": budget,
                "without": truth[0],
                "best": truth[sets].max(),
                "backups": int(sets[np.argmax(truth[sets])]).bit_count(),
                "by pairs": truth[sets[np.argmax(approximate[sets])]],
                "kendall": kendalltau(approximate[sets], truth[sets]).statistic,
            }
        )
    return pd.DataFrame(rows)


def main(folder: Path, seeds: int) -> None:
    """Run what is missing, print the tables and draw the figure."""
    table, names = measure(folder), [name.replace("_", " ") for name in list_places()]
    optima, pairs = find_optima(table, names), judge_pairs(table)
    searches = run_searches(table, folder / "searches.csv", seeds)
    summary = summarize_searches(searches)
    for frame in (optima, pairs, judge_backups(table), summary):
        print(frame.round(3).to_string(index=False), end="\n\n")
    save(draw(optima, table, searches), IMAGES / "redundancy.png", "png")


if __name__ == "__main__":
    main(
        Path(sys.argv[1]) if len(sys.argv) > 1 else Path("outputs/redundancy"),
        int(sys.argv[2]) if len(sys.argv) > 2 else 40,
    )
