"""Do designs rank alike in the planar simulator and in PyBullet? A study that can be interrupted.

Random designs in the three environments under the three treatments, the same designs under the
same draws in both simulators. Killed at any time it goes on where it was; it ends with the tables
of docs/fidelity.md and docs/img/agreement.png. Hours of processor time:

    python benchmarks/fidelity/agreement.py [--designs 60] [--draws 4] [--workers 2] [--folder F]

With ``--tables`` it flies nothing and makes the tables from the series that are finished.
"""

from argparse import ArgumentParser
from collections.abc import Iterator, Sequence
from itertools import combinations
from pathlib import Path
from typing import cast

import numpy as np
import pandas as pd
from agreement_figure import figure
from reliability import Chosen, ceiling, interval, kappa, reliability, spearman
from series import Series, random_designs

from evoros.base.arrays import Array
from evoros.fitness.equation_one import equation_one
from evoros.storage.tables import read_outcome

TREATMENTS = ("none", "random", "spatial")
PLANAR, PYBULLET = "planar", "pybullet"
FRESH = 5  # planar trials for each draw: the first under PyBullet's draws, the others fresh
CONTROLS = {
    "planar-5ms": ("simulator=planar", "simulator.time_step=0.005"),
    "pybullet-10ms": ("simulator=pybullet", "simulator.time_step=0.01"),
}
"""The same simulators with another step, which nothing should depend on; without failures."""
KEY = ["treatment", "draw", "design", "world"]


def all_series(draws: int) -> Iterator[Series]:
    """In the order in which they are flown: an early end leaves tables of fewer draws."""
    for seed in range(draws):
        for treatment in TREATMENTS:
            yield Series(PLANAR, treatment, seed, ("simulator=planar", f"trials={FRESH}"))
            yield Series(PYBULLET, treatment, seed, ("simulator=pybullet", "trials=1"))
    for seed in range(draws):
        for name, overrides in CONTROLS.items():
            yield Series(name, "none", seed, (*overrides, "trials=1"))


def flown(study: Path, series: Sequence[Series]) -> pd.DataFrame:
    """All missions of the finished series, each with its share of the fitness: Eq. 1."""
    missions = pd.concat([each.missions(study) for each in series if each.finished(study)])
    rows = cast(list[dict[str, str]], missions.to_dict("records"))
    typed = missions.assign(
        score=[equation_one(read_outcome(row)) for row in rows],
        design=missions.design.astype(int),
        completed=missions.completed == "true",
        progress=missions.progress.astype(float),
    )
    return typed.reset_index(drop=True)


def fitness(missions: pd.DataFrame, simulator: str, treatment: str) -> pd.DataFrame:
    """A row for each design, a column for each draw: the sum over the worlds."""
    chosen = missions[(missions.simulator == simulator) & (missions.treatment == treatment)]
    return chosen.pivot_table(index="design", columns="draw", values="score", aggfunc="sum")


def ranks(missions: pd.DataFrame) -> list[tuple[str, Array, Array]]:
    """The table of rank correlations; returns the mean fitness in PyBullet and in planar."""
    print("\n| treatment | draws | same draws | fresh draws | ceiling | of it | reliabilities |")
    print("|---|---|---|---|---|---|---|")
    measured: list[tuple[str, Array, Array, Array]] = []
    for treatment in TREATMENTS:
        real, plane = (fitness(missions, name, treatment) for name in (PYBULLET, PLANAR))
        if not real.empty:
            fresh = plane.drop(columns=real.columns).to_numpy()
            measured.append((treatment, real.to_numpy(), plane[real.columns].to_numpy(), fresh))
            _rank_row(*measured[-1])
    _, *columns = zip(*measured, strict=True)
    all_real, shared, fresh = (_stacked(cast(Sequence[Array], each)) for each in columns)
    _rank_row("pooled", all_real, shared, fresh, len(measured))
    return [(treatment, real, shared) for treatment, real, shared, _ in measured]


def _stacked(arrays: Sequence[Array]) -> Array:
    """One below the other, with the draws that all of them have."""
    least = min(each.shape[1] for each in arrays)
    return np.concatenate([each[:, :least] for each in arrays])


def _rank_row(name: str, real: Array, shared: Array, fresh: Array, copies: int = 1) -> None:
    """Designs are resampled with all of their ``copies``: rows a third apart are one design."""
    designs = len(real) // copies

    def rows(chosen: Chosen) -> Chosen:
        return np.concatenate([chosen + copy * designs for copy in range(copies)])

    def cell(other: Array) -> str:
        low, high = interval(
            designs,
            lambda chosen: spearman(
                real[rows(chosen)].mean(axis=1), other[rows(chosen)].mean(axis=1)
            ),
        )
        return f"{spearman(real.mean(axis=1), other.mean(axis=1)):.3f} ({low:.2f} to {high:.2f})"

    most = ceiling(real, fresh)
    share = spearman(real.mean(axis=1), fresh.mean(axis=1)) / most if most else np.nan
    each = f"{reliability(real):.2f}, {reliability(fresh):.2f}"
    print(
        f"| {name} | {real.shape[1]} | {cell(shared)} | {cell(fresh)} | {most:.3f} | "
        f"{100 * share:.0f} % | {each} |"
    )


def pairs(missions: pd.DataFrame, one: str, other: str) -> pd.DataFrame:
    """Missions of the same design in the same world under the same draws."""
    chosen = [missions[missions.simulator == name] for name in (one, other)]
    return chosen[0].merge(chosen[1], on=KEY, suffixes=("_one", "_other"))


def completions(missions: pd.DataFrame) -> None:
    """The table of completed missions."""
    both = pairs(missions, PYBULLET, PLANAR)
    print("\n| world | missions | both | PyBullet only | planar only | neither | kappa |", end="")
    print(" planar more often [percentage points] | progress |\n" + "|---" * 9 + "|")
    for world, there in [*both.groupby("world"), ("all", both)]:
        real, plane = there.completed_one.to_numpy(), there.completed_other.to_numpy()
        more, (low, high) = _excess(there)
        progress = f"{there.progress_one.mean():.3f}, {there.progress_other.mean():.3f}"
        print(
            f"| {world} | {len(there)} | {(real & plane).sum()} | {(real & ~plane).sum()} | "
            f"{(~real & plane).sum()} | {(~real & ~plane).sum()} | {kappa(real, plane):.2f} | "
            f"{more:+.1f} ({low:+.1f} to {high:+.1f}) | {progress} |"
        )


def _excess(there: pd.DataFrame) -> tuple[float, tuple[float, float]]:
    """By how much [%] more often the second completes; designs are resampled."""
    each = (there.completed_other.astype(float) - there.completed_one).groupby(there.design)
    sums, counts = each.sum().to_numpy(), each.count().to_numpy()
    bounds = interval(len(sums), lambda i: 100.0 * float(sums[i].sum() / counts[i].sum()))
    return 100.0 * float(sums.sum() / counts.sum()), bounds


def endings(missions: pd.DataFrame) -> None:
    """How missions end."""
    both = pairs(missions, PYBULLET, PLANAR)
    print("\n| PyBullet \\ planar | completed | collision | time limit |\n|---|---|---|---|")
    names = ("completed", "collision", "time_limit")
    for row in names:
        cells = [((both.ended_one == row) & (both.ended_other == name)).sum() for name in names]
        print(f"| {row.replace('_', ' ')} | " + " | ".join(map(str, cells)) + " |")


def controls(missions: pd.DataFrame) -> None:
    """How far the simulators agree with themselves, on the draws that all of them have flown."""
    there = missions[missions.treatment == "none"]
    names = [PYBULLET, PLANAR, *CONTROLS]
    draws = set.intersection(*(set(there[there.simulator == name].draw) for name in names))
    there = there[there.draw.isin(draws)]
    print(f"\n{len(draws)} draws without failures\n")
    print("| the same missions in | rank correlation | kappa | completed [%] |\n|---|---|---|---|")
    for one, other in combinations(names, 2) if draws else ():
        both = pairs(there, one, other)
        sums = both.groupby("design")[["score_one", "score_other"]].sum().to_numpy()
        low, high = interval(len(sums), lambda i, s=sums: spearman(*s[i].T))  # type: ignore[misc]
        a, b = both.completed_one.to_numpy(), both.completed_other.to_numpy()
        print(
            f"| {one}, {other} | {spearman(*sums.T):.3f} ({low:.2f} to {high:.2f}) | "
            f"{kappa(a, b):.2f} | {100 * a.mean():.1f}, {100 * b.mean():.1f} |"
        )


def main() -> None:
    parser = ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--folder", type=Path, default=Path("outputs/agreement"))
    parser.add_argument("--designs", type=int, default=60, help="when the folder is new")
    parser.add_argument("--draws", type=int, default=4, help="for each world and treatment")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--tables", action="store_true", help="of what is finished, flying nothing")
    given = parser.parse_args()
    study, series = given.folder.absolute(), list(all_series(given.draws))
    if not given.tables:
        random_designs(study, given.designs)
        for each in series:
            each.fly(study, given.workers)
    missions = flown(study, series)
    means = ranks(missions)
    completions(missions)
    endings(missions)
    controls(missions)
    figure(means)


if __name__ == "__main__":
    main()
