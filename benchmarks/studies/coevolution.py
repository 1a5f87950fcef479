"""Compares controllers on the dense fields, at a budget equal in missions.

The body evolves alone, with the numbers of the hand-made controller, or with the weights of a
neural one. Each run evolves as long as its missions, with its final choice, fit the budget.
Each champion is scored on 40 fresh trials, whose draws no run has met. The script prints the table
and draws docs/img/coevolution.png. What is already in the folder is not computed again:

    python benchmarks/studies/coevolution.py [folder] [seeds]
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from noise import COMMON, FINAL, FRESH_TRIALS, IMAGES, Recalled, end, run_long

import evoros
from evoros.analysis.drawing.style import COLUMN_IN, save, use_style
from evoros.analysis.statistics.small_samples import holm, median_interval
from evoros.analysis.statistics.two_samples import a12, brunner_munzel
from evoros.design.design import Design
from evoros.executor.protocol import Pool
from evoros.session.rebuilding import rebuild
from evoros.storage.run_folder import RunFolder

BUDGET = 1500  # missions of a run, its final choice included
DENSE = ["world=dense", "simulator=planar", "trials=2"]
HAND, CMA = "hand-made, GA", [*DENSE, "optimizer=cma_es"]
NUMBERS = {  # of the hand-made controller, with their ranges
    "avoidance.range_m": (0.5, 4.0),
    "avoidance.max_range_m": (0.3, 4.0),
    "avoidance.speed_mps": (0.1, 0.397),
    "avoidance.deadlock_difference_m": (0.0, 2.0),
    "avoidance.deadlock_sum_m": (0.0, 4.0),
    "navigation.speed_mps": (0.1, 0.397),
    "navigation.amplitude_deg": (0.0, 60.0),
    "navigation.gain": (0.5, 4.0),
}
TUNED = [
    f"+design.genes.{key.replace('.', '_')}={{_target_: evoros.design.genes.Gene, "
    f"key: controller.{key}, low: {low}, high: {high}}}"
    for key, (low, high) in NUMBERS.items()
]
VARIANTS = {  # what evolves, and generations enough for the budget
    HAND: (DENSE, 32),
    "hand-made, CMA-ES": (CMA, 14),
    "hand-made, its numbers evolve": ([*CMA, *TUNED], 14),
    "neural, CMA-ES": ([*CMA, "controller=neural"], 14),
    "neural, GA": ([*DENSE, "controller=neural"], 32),
}


def find_champion(run: evoros.Run, pool: Pool) -> tuple[dict[str, object], Design]:
    """End a run within the budget, by a final choice; return its champion and what it cost."""
    experiment = rebuild(run.path).experiment
    with RunFolder(run.path) as record:
        outcomes = {key: outcome for key, _, outcome in record.table.read(record.read_mission)}
    missions = run.missions.groupby("generation").size().cumsum()
    generations = int((missions <= BUDGET - FINAL.finalists * 5 * len(experiment.world)).sum())
    if generations == len(missions):
        raise RuntimeError(f"{run.path}: too few generations for {BUDGET} missions")
    recalled = Recalled(outcomes)
    row = end(experiment, recalled, generations, pool, True)
    return row | {"genes": experiment.space.size}, recalled.champions[-1].design


def score_fresh(overrides: list[str], seed: int, run: evoros.Run) -> pd.DataFrame:
    """Return a row with the champion of a run and its scores on fresh trials."""
    fresh = [*overrides, *COMMON, f"trials={FRESH_TRIALS}", f"seed={seed}"]
    with evoros.Evaluator(fresh) as evaluator:
        assert evaluator._pool is not None
        row, design = find_champion(run, evaluator._pool)
        table = evaluator.evaluate([design])
    columns = [name for name in map(str, table) if "fitness_" in name or "completed" in name]
    return pd.concat([pd.DataFrame([row]), table[columns]], axis=1)


def results(folder: Path, seeds: int) -> pd.DataFrame:
    """All rows; computes those that are not yet in ``coevolution.csv`` and adds them."""
    file = folder / "coevolution.csv"
    for seed in range(seeds):
        for variant, (overrides, generations) in VARIANTS.items():
            known = (
                pd.read_csv(file) if file.exists() else pd.DataFrame({"variant": [], "seed": []})
            )
            if ((known.variant == variant) & (known.seed == seed)).any():
                continue
            path = folder / f"{variant.replace(' ', '_').replace(',', '')}_{seed}"
            run = run_long(path, [*overrides, *COMMON, f"seed={seed}"], generations)
            row = score_fresh(overrides, seed, run)
            row.insert(0, "variant", variant)
            row.insert(1, "seed", seed)
            pd.concat([known, row]).to_csv(file, index=False)
            print(row.to_string(index=False), flush=True)
    return pd.read_csv(file)


def summarize(table: pd.DataFrame) -> pd.DataFrame:
    """Return medians with bootstrap intervals, and tests against the hand-made controller."""
    groups: dict[Any, pd.DataFrame] = dict(iter(table.groupby("variant", sort=False)))
    baseline = groups[HAND].fitness_mean.to_numpy()
    others = [name for name in groups if name != HAND]
    p = holm([brunner_munzel(groups[name].fitness_mean.to_numpy(), baseline) for name in others])
    corrected = dict(zip(others, p, strict=True))
    worlds = [name for name in map(str, table) if name.endswith("_completed")]
    rows = []
    for name, group in groups.items():
        fresh = group.fitness_mean.to_numpy()
        interval = median_interval(fresh)
        rows.append(
            {
                "variant": name,
                "n": len(group),
                "genes": group.genes.iloc[0],
                "missions": group.missions.mean(),
                "recorded": group.recorded.median(),
                "validated": np.median(fresh),
                "low": interval.low,
                "high": interval.high,
                "worst": fresh.min(),
                "completed %": 100 * group[worlds].to_numpy().mean(),
                "p (Holm)": corrected.get(name, np.nan),
                "A12": a12(fresh, baseline),
            }
        )
    return pd.DataFrame(rows)


def draw(table: pd.DataFrame) -> Figure:
    """Draw the validated fitness of the champions, with medians and intervals."""
    with use_style():
        whole = Figure(figsize=(1.5 * COLUMN_IN, 0.7 * COLUMN_IN), layout="constrained")
        axes, summary = whole.subplots(), summarize(table)
        y = np.arange(len(summary))[::-1]
        for place, name in zip(y, summary.variant, strict=True):
            dots = table[table.variant == name].fitness_mean
            axes.plot(dots, np.full(len(dots), place), "o", c="#0072b2", ms=3.2, alpha=0.6, mew=0)
        axes.hlines(y, summary.low, summary.high, color="#0072b2", lw=1.6)
        axes.plot(summary.validated, y, "o", c="#0072b2", ms=5)
        axes.set_yticks(y, list(summary.variant))
        axes.set_ylim(-0.5, len(summary) - 0.5)
        axes.set_xlabel(f"fitness (Eq. 1), validated on {FRESH_TRIALS} fresh trials")
        axes.spines[["top", "right"]].set_visible(False)
    return whole


def main(folder: Path, seeds: int) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    table = results(folder, seeds)
    print(summarize(table).round(4).to_string(index=False))
    save(draw(table), IMAGES / "coevolution.png", "png")


if __name__ == "__main__":
    main(
        Path(sys.argv[1]) if len(sys.argv) > 1 else Path("outputs/coevolution"),
        int(sys.argv[2]) if len(sys.argv) > 2 else 5,
    )
