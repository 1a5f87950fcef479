"""The tables of benchmarks/fidelity/agreement.py."""

from collections.abc import Sequence
from functools import partial
from itertools import combinations
from typing import cast

import numpy as np
import pandas as pd
from reliability import Rows, ceiling, interval, kappa, reliability, spearman, unlimited

from evoros.base.arrays import Array

TREATMENTS = ("none", "random", "spatial")
PLANAR, PYBULLET, MUJOCO, GAZEBO = "planar", "pybullet", "mujoco", "gazebo"
ENGINES = (PYBULLET, MUJOCO, GAZEBO)
KEY = ["treatment", "draw", "design", "world"]
ENDS = ("completed", "collision", "time_limit")
SHUFFLES = 2000


def fitness(missions: pd.DataFrame, simulator: str, treatment: str) -> pd.DataFrame:
    """The fitness of each design (rows) in each trial (columns): the sum over the worlds."""
    chosen = missions[(missions.simulator == simulator) & (missions.treatment == treatment)]
    return chosen.pivot_table(index="design", columns="draw", values="score", aggfunc="sum")


def rank_with_planar(missions: pd.DataFrame, engine: str) -> list[tuple[str, Array, Array]]:
    """Print the table of rank correlations of an engine and the planar simulator.

    Returns, for each treatment, the fitness (designs, trials) in the engine and in planar.
    """
    print(f"\n{engine}, planar\n\n| failure | trials | same draws | fresh draws |", end="")
    print(" ceiling | share | reliabilities |")
    print("|---|---|---|---|---|---|---|")
    measured: list[tuple[str, Array, Array, Array]] = []
    for treatment in TREATMENTS:
        real, plane = (fitness(missions, name, treatment) for name in (engine, PLANAR))
        if not real.empty:
            fresh = plane.drop(columns=real.columns).to_numpy()
            measured.append((treatment, real.to_numpy(), plane[real.columns].to_numpy(), fresh))
            _rank_row(*measured[-1])
    if len(measured) > 1:
        _, *columns = zip(*measured, strict=True)
        all_real, shared, fresh = (_stack(cast(Sequence[Array], column)) for column in columns)
        _rank_row("pooled", all_real, shared, fresh, len(measured))
    return [(treatment, real, shared) for treatment, real, shared, _ in measured]


def _stack(arrays: Sequence[Array]) -> Array:
    """Stack the rows of the arrays, with the trials that all of them have."""
    trials = min(array.shape[1] for array in arrays)
    return np.concatenate([array[:, :trials] for array in arrays])


def _rank_row(name: str, real: Array, shared: Array, fresh: Array, copies: int = 1) -> None:
    """Print one row. The arrays hold ``copies`` blocks of the same designs.

    The bootstrap resamples a design together with its rows in all blocks.
    """
    designs = len(real) // copies

    def rows(chosen: Rows) -> Rows:
        return np.concatenate([chosen + copy * designs for copy in range(copies)])

    def cell(other: Array) -> str:
        low, high = interval(
            designs,
            lambda chosen: spearman(
                real[rows(chosen)].mean(axis=1), other[rows(chosen)].mean(axis=1)
            ),
        )
        return f"{spearman(real.mean(axis=1), other.mean(axis=1)):.3f} ({low:.2f} to {high:.2f})"

    print(f"| {name} | {real.shape[1]} | {cell(shared)} | {cell(fresh)} | ", end="")
    if real.shape[1] < 2:
        print(f"| | , {reliability(fresh):.2f} |")
        return
    maximum = ceiling(real, fresh)
    share = spearman(real.mean(axis=1), fresh.mean(axis=1)) / maximum if maximum else np.nan
    reliabilities = f"{reliability(real):.2f}, {reliability(fresh):.2f}"
    print(f"{maximum:.3f} | {100 * share:.0f} % | {reliabilities} |")


def rank_engines(missions: pd.DataFrame) -> dict[str, Array]:
    """Print the rank correlations of all pairs, on the trials that all have.

    Returns the fitness (designs, trials) in each simulator, without failures.
    """
    measured: dict[str, Array] = {}
    names = (PLANAR, *ENGINES)
    print("\n| failure | trials | " + " | ".join(map(", ".join, combinations(names, 2))) + " |")
    print("|---" * (2 + len(list(combinations(names, 2)))) + "|")
    for treatment in TREATMENTS:
        tables = {name: fitness(missions, name, treatment) for name in names}
        draws = [d for d in tables[PLANAR] if all(d in tables[name] for name in ENGINES)]
        if draws:
            means = {name: table[draws].to_numpy().mean(axis=1) for name, table in tables.items()}
            cells = [_between(means[a], means[b]) for a, b in combinations(names, 2)]
            print(f"| {treatment} | {len(draws)} | " + " | ".join(cells) + " |")
            outcomes = {name: table[draws].to_numpy() for name, table in tables.items()}
            measured = measured or outcomes
    return measured


def _between(a: Array, b: Array) -> str:
    low, high = interval(len(a), lambda rows: spearman(a[rows], b[rows]))
    return f"{spearman(a, b):.3f} ({low:.2f} to {high:.2f})"


def rank_pair(missions: pd.DataFrame, first: str, second: str) -> None:
    """Print the rank correlations of two engines, on the trials that both have.

    The fitness of the last row is the mean over the treatments.
    """
    measured = []
    print(f"\n| {first}, {second} | trials | rank correlation | with unlimited trials |")
    print("|---" * 4 + "|")
    for treatment in TREATMENTS:
        tables = [fitness(missions, name, treatment) for name in (first, second)]
        draws = tables[0].columns.intersection(tables[1].columns)
        measured.append([table[draws].to_numpy() for table in tables])
    trials = min(table.shape[1] for table, _ in measured)
    pooled = np.mean([[table[:, :trials] for table in tables] for tables in measured], axis=0)
    for name, (a, b) in zip((*TREATMENTS, "pooled"), (*measured, pooled), strict=True):
        print(f"| {name} | {a.shape[1]} | {_between(a.mean(axis=1), b.mean(axis=1))} | ", end="")
        if a.shape[1] > 1:
            low, high = interval(len(a), partial(_unlimited, a, b))
            print(f"{unlimited(a, b):.3f} ({low:.2f} to {high:.2f}) ", end="")
        print("|")


def _unlimited(a: Array, b: Array, rows: Rows) -> float:
    return unlimited(a[rows], b[rows])


def pair(missions: pd.DataFrame, first: str, second: str) -> pd.DataFrame:
    """Join missions of the same design in the same world under the same draws."""
    left, right = (missions[missions.simulator == name] for name in (first, second))
    return left.merge(right, on=KEY, suffixes=("_first", "_second"))


def completions(missions: pd.DataFrame, first: str, second: str) -> None:
    """Print the table of missions that two simulators complete."""
    both = pair(missions, first, second)
    print(f"\n| world | missions | both | {first} only | {second} only | neither | kappa |", end="")
    print(f" {second} more often [percentage points] | progress |\n" + "|---" * 9 + "|")
    for world, rows in [*both.groupby("world"), ("all", both)]:
        a, b = rows.completed_first.to_numpy(), rows.completed_second.to_numpy()
        excess, (low, high) = _excess(rows)
        progress = f"{rows.progress_first.mean():.3f}, {rows.progress_second.mean():.3f}"
        print(
            f"| {world} | {len(rows)} | {(a & b).sum()} | {(a & ~b).sum()} | {(~a & b).sum()} | "
            f"{(~a & ~b).sum()} | {kappa(a, b):.2f} | {excess:+.1f} ({low:+.1f} to {high:+.1f}) | "
            f"{progress} |"
        )


def _excess(rows: pd.DataFrame) -> tuple[float, tuple[float, float]]:
    """How much more often [percentage points] the second completes, with its bootstrap range."""
    differences = rows.completed_second.astype(float) - rows.completed_first
    by_design = differences.groupby(rows.design)
    sums, counts = by_design.sum().to_numpy(), by_design.count().to_numpy()
    bounds = interval(len(sums), lambda i: 100.0 * float(sums[i].sum() / counts[i].sum()))
    return 100.0 * float(sums.sum() / counts.sum()), bounds


def endings(missions: pd.DataFrame, first: str, second: str) -> None:
    """Print the table of how missions end."""
    both = pair(missions, first, second)
    print(f"\n| {first} \\ {second} | " + " | ".join(ENDS).replace("_", " ") + " |")
    print("|---" * 4 + "|")
    for row in ENDS:
        cells = [((both.ended_first == row) & (both.ended_second == name)).sum() for name in ENDS]
        print(f"| {row.replace('_', ' ')} | " + " | ".join(map(str, cells)) + " |")


def outvoted(missions: pd.DataFrame) -> None:
    """Print how often all simulators but one end a mission in one way and that one in another."""
    names = (PLANAR, *ENGINES)
    chosen = missions[missions.simulator.isin(names)]
    ends = chosen.pivot(index=KEY, columns="simulator", values="ended").dropna()
    print(f"\n{len(ends)} missions in all simulators\n")
    print("| | the same end |\n|---|---|")
    same = {name: ends.drop(columns=name).nunique(axis=1) == 1 for name in names}
    whole = ends.nunique(axis=1) == 1
    print(f"| all | {whole.sum()} |")
    for name in names:
        print(f"| only {name} differs | {(same[name] & ~whole).sum()} |")
    print(f"| all ends occur | {(ends.nunique(axis=1) == len(ENDS)).sum()} |")


def controls(missions: pd.DataFrame, names: Sequence[str]) -> None:
    """Print how far the simulators agree with themselves, and what chance alone gives.

    The pairs have the trials that all simulators have of which there are any.
    """
    missions = missions[missions.treatment == "none"]
    names = [name for name in names if (missions.simulator == name).any()]
    draws = set.intersection(*(set(missions[missions.simulator == name].draw) for name in names))
    shared = missions[missions.draw.isin(draws)]
    print(f"\n{len(draws)} trials without failures\n")
    print(
        "| the same missions in | rank correlation | kappa | completed [%] |\n" + "|---" * 4 + "|"
    )
    for first, second in combinations(names, 2):
        both = pair(shared, first, second)
        sums = both.groupby("design")[["score_first", "score_second"]].sum().to_numpy()
        a, b = both.completed_first.to_numpy(), both.completed_second.to_numpy()
        print(
            f"| {first}, {second} | {_between(*sums.T)} | {kappa(a, b):.2f} | "
            f"{100 * a.mean():.1f}, {100 * b.mean():.1f} |"
        )
    for name in names:
        table = fitness(missions, name, "none").to_numpy()
        if table.shape[1] > 1:
            correlations = [
                spearman(*table[:, both].T) for both in combinations(range(table.shape[1]), 2)
            ]
            print(f"| {name}, two trials with different draws | {np.mean(correlations):.3f} | | |")
    designs = np.arange(float(missions.design.nunique()))
    rng = np.random.default_rng(0)
    chance = [spearman(designs, rng.permutation(designs)) for _ in range(SHUFFLES)]
    low, high = np.quantile(chance, (0.025, 0.975))
    print(f"| designs in random order | {np.mean(chance):.3f} ({low:.2f} to {high:.2f}) | | |")
