"""Studies whether designs rank alike in the planar simulator and in PyBullet.

Takes the same random designs under the same draws through the three environments and the three
treatments in both simulators. The study can be killed at any time and continues where it stopped.
At its end it prints the tables of docs/fidelity.md and draws docs/img/agreement.png. It takes hours
of processor time:

    python benchmarks/fidelity/agreement.py [--designs 60] [--trials 4] [--workers 2] [--folder F]

With ``--tables`` it runs no mission and makes the tables from the finished series.
"""

from argparse import ArgumentParser
from collections.abc import Iterator, Sequence
from itertools import combinations
from pathlib import Path
from typing import cast

import numpy as np
import pandas as pd
from agreement_figure import figure
from reliability import Rows, ceiling, interval, kappa, reliability, spearman
from series import Series, random_designs

from evoros.base.arrays import Array
from evoros.fitness.equation_one import equation_one
from evoros.storage.tables import read_outcome

TREATMENTS = ("none", "random", "spatial")
PLANAR, PYBULLET = "planar", "pybullet"
PLANAR_TRIALS = 5  # for each seed: the first with PyBullet's draws, the others with fresh draws
CONTROLS = {
    "planar-5ms": ("simulator=planar", "simulator.time_step=0.005"),
    "pybullet-10ms": ("simulator=pybullet", "simulator.time_step=0.01"),
}
"""The same simulators with another step, which should not matter; without failures."""
KEY = ["treatment", "draw", "design", "world"]


def all_series(trials: int) -> Iterator[Series]:
    """Yield the series in the order in which they run, so that an early end leaves fewer trials."""
    for seed in range(trials):
        for treatment in TREATMENTS:
            yield Series(PLANAR, treatment, seed, ("simulator=planar", f"trials={PLANAR_TRIALS}"))
            yield Series(PYBULLET, treatment, seed, ("simulator=pybullet", "trials=1"))
    for seed in range(trials):
        for name, overrides in CONTROLS.items():
            yield Series(name, "none", seed, (*overrides, "trials=1"))


def read_missions(study: Path, series: Sequence[Series]) -> pd.DataFrame:
    """All missions of the finished series, each with its score by Eq. 1."""
    missions = pd.concat([part.missions(study) for part in series if part.finished(study)])
    rows = cast(list[dict[str, str]], missions.to_dict("records"))
    typed = missions.assign(
        score=[equation_one(read_outcome(row)) for row in rows],
        design=missions.design.astype(int),
        completed=missions.completed == "true",
        progress=missions.progress.astype(float),
    )
    return typed.reset_index(drop=True)


def fitness(missions: pd.DataFrame, simulator: str, treatment: str) -> pd.DataFrame:
    """The fitness of each design (rows) in each trial (columns): the sum over the worlds."""
    chosen = missions[(missions.simulator == simulator) & (missions.treatment == treatment)]
    return chosen.pivot_table(index="design", columns="draw", values="score", aggfunc="sum")


def ranks(missions: pd.DataFrame) -> list[tuple[str, Array, Array]]:
    """Print the table of rank correlations.

    Returns, for each treatment, the fitness (designs, trials) in PyBullet and in planar.
    """
    print("\n| failure | trials | same draws | fresh draws | ceiling | share | reliabilities |")
    print("|---|---|---|---|---|---|---|")
    measured: list[tuple[str, Array, Array, Array]] = []
    for treatment in TREATMENTS:
        real, plane = (fitness(missions, name, treatment) for name in (PYBULLET, PLANAR))
        if not real.empty:
            fresh = plane.drop(columns=real.columns).to_numpy()
            measured.append((treatment, real.to_numpy(), plane[real.columns].to_numpy(), fresh))
            _rank_row(*measured[-1])
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

    maximum = ceiling(real, fresh)
    share = spearman(real.mean(axis=1), fresh.mean(axis=1)) / maximum if maximum else np.nan
    reliabilities = f"{reliability(real):.2f}, {reliability(fresh):.2f}"
    print(
        f"| {name} | {real.shape[1]} | {cell(shared)} | {cell(fresh)} | {maximum:.3f} | "
        f"{100 * share:.0f} % | {reliabilities} |"
    )


def pair(missions: pd.DataFrame, first: str, second: str) -> pd.DataFrame:
    """Join missions of the same design in the same world under the same draws."""
    left, right = (missions[missions.simulator == name] for name in (first, second))
    return left.merge(right, on=KEY, suffixes=("_first", "_second"))


def completions(missions: pd.DataFrame) -> None:
    """Print the table of completed missions."""
    both = pair(missions, PYBULLET, PLANAR)
    print("\n| world | missions | both | PyBullet only | planar only | neither | kappa |", end="")
    print(" planar more often [percentage points] | progress |\n" + "|---" * 9 + "|")
    for world, rows in [*both.groupby("world"), ("all", both)]:
        real, plane = rows.completed_first.to_numpy(), rows.completed_second.to_numpy()
        excess, (low, high) = _excess(rows)
        progress = f"{rows.progress_first.mean():.3f}, {rows.progress_second.mean():.3f}"
        print(
            f"| {world} | {len(rows)} | {(real & plane).sum()} | {(real & ~plane).sum()} | "
            f"{(~real & plane).sum()} | {(~real & ~plane).sum()} | {kappa(real, plane):.2f} | "
            f"{excess:+.1f} ({low:+.1f} to {high:+.1f}) | {progress} |"
        )


def _excess(rows: pd.DataFrame) -> tuple[float, tuple[float, float]]:
    """How much more often [percentage points] the second completes, with its bootstrap range."""
    differences = rows.completed_second.astype(float) - rows.completed_first
    by_design = differences.groupby(rows.design)
    sums, counts = by_design.sum().to_numpy(), by_design.count().to_numpy()
    bounds = interval(len(sums), lambda i: 100.0 * float(sums[i].sum() / counts[i].sum()))
    return 100.0 * float(sums.sum() / counts.sum()), bounds


def endings(missions: pd.DataFrame) -> None:
    """Print the table of how missions end."""
    both = pair(missions, PYBULLET, PLANAR)
    print("\n| PyBullet \\ planar | completed | collision | time limit |\n|---|---|---|---|")
    names = ("completed", "collision", "time_limit")
    for row in names:
        cells = [((both.ended_first == row) & (both.ended_second == name)).sum() for name in names]
        print(f"| {row.replace('_', ' ')} | " + " | ".join(map(str, cells)) + " |")


def controls(missions: pd.DataFrame) -> None:
    """Print how far the simulators agree with themselves, on the trials that all of them have."""
    missions = missions[missions.treatment == "none"]
    names = [PYBULLET, PLANAR, *CONTROLS]
    draws = set.intersection(*(set(missions[missions.simulator == name].draw) for name in names))
    missions = missions[missions.draw.isin(draws)]
    print(f"\n{len(draws)} trials without failures\n")
    print("| the same missions in | rank correlation | kappa | completed [%] |\n|---|---|---|---|")
    for first, second in combinations(names, 2) if draws else ():
        both = pair(missions, first, second)
        sums = both.groupby("design")[["score_first", "score_second"]].sum().to_numpy()
        low, high = interval(len(sums), lambda i, s=sums: spearman(*s[i].T))  # type: ignore[misc]
        a, b = both.completed_first.to_numpy(), both.completed_second.to_numpy()
        print(
            f"| {first}, {second} | {spearman(*sums.T):.3f} ({low:.2f} to {high:.2f}) | "
            f"{kappa(a, b):.2f} | {100 * a.mean():.1f}, {100 * b.mean():.1f} |"
        )


def main() -> None:
    parser = ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--folder", type=Path, default=Path("outputs/agreement"))
    parser.add_argument("--designs", type=int, default=60, help="when the folder is new")
    parser.add_argument("--trials", type=int, default=4, help="for each treatment")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--tables", action="store_true", help="make the tables of finished series")
    options = parser.parse_args()
    study, series = options.folder.absolute(), list(all_series(options.trials))
    if not options.tables:
        random_designs(study, options.designs)
        for part in series:
            part.run(study, options.workers)
    missions = read_missions(study, series)
    means = ranks(missions)
    completions(missions)
    endings(missions)
    controls(missions)
    figure(means)


if __name__ == "__main__":
    main()
