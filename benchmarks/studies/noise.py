"""Compares answers to noise at a budget equal in missions, on fresh trials of the champions.

Each run evolves as long as its missions fit the budget, and ends with the best of its last
generation. Or it ends earlier, by the missions of a final choice, and with its winner. Everything
counts: further trials of survivors, and the final choice. Each champion is scored on 40 fresh
trials, whose draws no run has met. The script prints the table and draws docs/img/noise_CASE.png.
Runs and scores that are already in the folder are not computed again:

    python benchmarks/studies/noise.py spatial|random|none|dense [folder] [seeds]
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

import evoros
from evoros.allocation.halving import SequentialHalving
from evoros.analysis.drawing.style import COLUMN_IN, save, use_style
from evoros.analysis.statistics.small_samples import holm, median_interval
from evoros.analysis.statistics.two_samples import a12, brunner_munzel
from evoros.base.arrays import Array
from evoros.certificate.final_choice import FinalChoice
from evoros.dispatch.dispatcher import MissionResult
from evoros.evolution.experiment import Experiment
from evoros.evolution.journal import Champion, Watcher
from evoros.evolution.loop import evolve
from evoros.executor.protocol import Pool
from evoros.mission.mission import Mission, MissionKey, Outcomes
from evoros.session.rebuilding import rebuild
from evoros.storage.run_folder import RunFolder

CASES = {  # the evolved values, and the missions of a run
    "spatial": (["failure=spatial", "simulator=planar"], 950),
    "random": (["failure=random", "simulator=planar"], 950),
    "none": (["failure=none", "simulator=planar"], 950),
    "dense": (["world=dense", "simulator=planar"], 950),
}
VARIANTS = {  # what each changes, and generations enough for the budget
    "one trial": (["trials=1", "allocation=once"], 38),
    "two trials": (["trials=2", "allocation=once"], 18),
    "two trials, no common draws": (["trials=2", "allocation=once", "draws=individual"], 18),
    "lifelong": (["trials=1", "allocation=lifelong"], 24),
    "racing": (["trials=1", "allocation=racing", "allocation.max_trials=4"], 11),
    "halving": (["trials=1", "allocation=halving", "allocation.budget=2"], 13),
    "successive rejects": (["allocation=successive_rejects", "allocation.budget=2"], 30),
}
SEARCHES = {  # of "spatial" alone
    "random designs": (["optimizer=random_search", "optimizer.population_size=20"], 18),
    "two trials, CMA-ES": (["trials=2", "optimizer=cma_es", "optimizer.population_size=12"], 15),
    "two trials, small steps": (
        [
            "trials=2",
            "optimizer.mutation_step=0.3",
            "optimizer.mutation_probability=0.4",
            "optimizer.population_size=14",
        ],
        18,
    ),
}
FINAL = FinalChoice(SequentialHalving(budget=5, max_trials=1000), finalists=20)
FRESH_TRIALS = 40
COMMON = ["figures=[]", "optimizer.validation_trials=0", "executor.workers=2"]
BASELINE = ("one trial", False)
IMAGES = Path(__file__).parents[2] / "docs" / "img"


@dataclass
class Recalled(Watcher):
    """A journal that has the missions of a run, and an observer; it writes nothing."""

    outcomes: dict[MissionKey, Outcomes]
    champions: list[Champion] = field(default_factory=list)
    needed: set[MissionKey] = field(default_factory=set)

    def has(self, mission: Mission) -> bool:
        """Whether the mission is known; it counts from now on."""
        self.needed.add(mission.key)
        return mission.key in self.outcomes

    def find(self, mission: Mission) -> Outcomes | None:
        """Return the outcomes of a mission."""
        return self.outcomes.get(mission.key)

    def record(self, results: Sequence[MissionResult]) -> None:
        """Keep the outcomes of new missions, which a final choice runs."""
        self.outcomes |= {mission.key: outcome for mission, outcome in results}

    def has_champion(self, champion: Champion) -> bool:
        """Note the champion, so that it is not written."""
        self.champions.append(champion)
        return True

    def drop_trajectories(self, missions: Sequence[Mission]) -> list[Mission]:
        """Keep none, and so make none."""
        return []

    def read_trajectory(self, mission: Mission) -> Array:
        """Refuse: no trajectory is kept."""
        raise NotImplementedError

    def _ignore(self, *_: object) -> None:
        pass

    keep_log = keep_trajectory = write_generation = write_champions = write_champion = _ignore


def list_variants(case: str) -> dict[str, tuple[list[str], int]]:
    """Return the variants that are compared: answers to noise, and other searches."""
    return VARIANTS | SEARCHES if case == "spatial" else VARIANTS


def run_long(folder: Path, overrides: Sequence[str], generations: int) -> evoros.Run:
    """Return the run in the folder; start or finish it if necessary."""
    if (folder / "missions.csv").exists():
        run = evoros.load_run(folder)
        return run if run.status["state"] == "finished" else evoros.resume(folder)
    return evoros.run([*overrides, f"optimizer.generations={generations}"], folder)


def end(
    experiment: Experiment, recalled: Recalled, generations: int, pool: Pool, final: bool
) -> dict[str, object]:
    """End the run after so many generations; return its champion and what it cost."""
    recalled.needed.clear()
    chosen = replace(experiment, final_choice=FINAL if final else None)
    certificate = evolve(chosen, recalled, recalled, generations, pool).certificate
    return {
        "design": certificate.design,
        "generations": generations,
        "missions": len(recalled.needed),
        "recorded": certificate.recorded_fitness,
    }


def end_twice(run: evoros.Run, budget: int, pool: Pool) -> list[tuple[dict[str, object], Champion]]:
    """End a run of the budget without and with a final choice."""
    experiment = rebuild(run.path).experiment
    with RunFolder(run.path) as record:
        outcomes = {key: outcome for key, _, outcome in record.table.read(record.read_mission)}
    missions = run.missions.groupby("generation").size().cumsum()
    ends = []
    for final in (False, True):
        cost = FINAL.finalists * 5 * len(experiment.world) if final else 0
        generations = int((missions <= budget - cost).sum())
        if generations == len(missions):
            raise RuntimeError(f"{run.path}: too few generations for {budget - cost} missions")
        recalled = Recalled(dict(outcomes))
        row = {"final": final, **end(experiment, recalled, generations, pool, final)}
        ends.append((row, recalled.champions[-1]))
    return ends


def study_seed(case: str, folder: Path, seed: int, variants: Sequence[str]) -> pd.DataFrame:
    """Return a row for each of these variants without and with a final choice."""
    base, budget = CASES[case]
    rows, champions = [], []
    fresh = [*base, *COMMON, f"trials={FRESH_TRIALS}", f"seed={seed}"]
    with evoros.Evaluator(fresh) as evaluator:
        assert evaluator._pool is not None
        for variant in variants:
            changes, generations = list_variants(case)[variant]
            path = folder / case / f"{variant.replace(' ', '_').replace(',', '')}_{seed}"
            overrides = [*base, *changes, *COMMON, f"seed={seed}"]
            run = run_long(path, overrides, generations)
            for row, champion in end_twice(run, budget, evaluator._pool):
                rows.append({"variant": variant, "seed": seed, **row})
                champions.append(champion.design)
        table = evaluator.evaluate(champions)
    columns = [name for name in map(str, table) if "fitness_" in name or "completed" in name]
    return pd.concat([pd.DataFrame(rows), table[columns].reset_index(drop=True)], axis=1)


def results(case: str, folder: Path, seeds: int) -> pd.DataFrame:
    """All rows; computes those that are not yet in ``CASE.csv`` and adds them."""
    file = folder / f"{case}.csv"
    for seed in range(seeds):
        known = pd.read_csv(file) if file.exists() else pd.DataFrame({"seed": [], "variant": []})
        done = set(known[known.seed == seed].variant)
        missing = [variant for variant in list_variants(case) if variant not in done]
        if missing:
            rows = study_seed(case, folder, seed, missing)
            pd.concat([known, rows] if len(known) else [rows]).to_csv(file, index=False)
            print(rows.to_string(index=False), flush=True)
    return pd.read_csv(file)


def summarize(table: pd.DataFrame) -> pd.DataFrame:
    """Return medians with bootstrap intervals, and tests against one trial, no final choice."""
    groups: dict[Any, pd.DataFrame] = dict(iter(table.groupby(["variant", "final"], sort=False)))
    baseline = groups[BASELINE].fitness_mean.to_numpy()
    others = [key for key in groups if key != BASELINE]
    p = holm([brunner_munzel(groups[key].fitness_mean.to_numpy(), baseline) for key in others])
    corrected = dict(zip(others, p, strict=True))
    rows = []
    for key, group in groups.items():
        fresh = group.fitness_mean.to_numpy()
        interval = median_interval(fresh)
        excess = group.recorded / group.fitness_mean - 1
        rows.append(
            {
                "variant": key[0],
                "final": key[1],
                "n": len(group),
                "missions": group.missions.mean(),
                "recorded": group.recorded.median(),
                "validated": np.median(fresh),
                "low": interval.low,
                "high": interval.high,
                "gain": np.median(fresh) - np.median(baseline),
                "mean gain": fresh.mean() - baseline.mean(),
                "excess %": 100 * excess.median(),
                "p (Holm)": corrected.get(key, np.nan),
                "A12": a12(fresh, baseline),
            }
        )
    return pd.DataFrame(rows)


def draw(table: pd.DataFrame) -> Figure:
    """Draw the validated fitness of champions, with medians and intervals, and the recorded."""
    with use_style():
        whole = Figure(figsize=(1.6 * COLUMN_IN, 1.05 * COLUMN_IN), layout="constrained")
        axes, summary = whole.subplots(), summarize(table)
        names = list(dict.fromkeys(summary.variant))
        for final, colour, offset in ((False, "#0072b2", 0.17), (True, "#d55e00", -0.17)):
            rows: Any = summary[summary.final == final]
            y = np.array([len(names) - 1 - names.index(name) for name in rows.variant]) + offset
            for place, name in zip(y, rows.variant, strict=True):
                dots: Any = table[(table.variant == name) & (table.final == final)].fitness_mean
                axes.plot(dots, np.full(len(dots), place), "o", c=colour, ms=3.2, alpha=0.6, mew=0)
            label = "final choice" if final else "best of the last generation"
            axes.hlines(y, rows.low, rows.high, color=colour, lw=1.6)
            axes.plot(rows.validated, y, "o", c=colour, ms=5, label=f"{label}: validated")
            empty: dict[str, Any] = {"mfc": "white", "mec": colour, "ms": 5, "zorder": 1}
            axes.plot(rows.recorded, y, "o", label=f"{label}: recorded", **empty)
        axes.set_yticks(range(len(names)), names[::-1])
        axes.set_xlabel(f"fitness (Eq. 1), validated on {FRESH_TRIALS} fresh trials")
        axes.spines[["top", "right"]].set_visible(False)
        whole.legend(loc="outside lower center", ncols=2, frameon=False)
    return whole


def main(case: str, folder: Path, seeds: int) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    table = results(case, folder, seeds)
    print(summarize(table).round(3).to_string(index=False))
    save(draw(table), IMAGES / f"noise_{case}.png", "png")


if __name__ == "__main__":
    main(
        sys.argv[1] if len(sys.argv) > 1 else "spatial",
        Path(sys.argv[2]) if len(sys.argv) > 2 else Path("outputs/noise"),
        int(sys.argv[3]) if len(sys.argv) > 3 else 10,
    )
