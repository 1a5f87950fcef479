"""Studies whether designs rank alike in the planar simulator, PyBullet, MuJoCo and Gazebo.

Takes the same random designs under the same draws through the three environments and the three
treatments in all simulators. The study can be killed at any time and continues where it stopped.
At its end it prints the tables of docs/fidelity.md and draws docs/img/agreement.png and
agreement_engines.png. It takes hours of processor time:

    python benchmarks/fidelity/agreement.py [--designs 60] [--trials 4] [--workers 2] [--folder F]

With ``--tables`` it runs no mission and makes the tables from the finished series.
"""

from argparse import ArgumentParser
from collections.abc import Iterator, Sequence
from itertools import combinations
from pathlib import Path
from typing import cast

import pandas as pd
from agreement_figure import figure, figure_of_pairs
from agreement_tables import (
    ENGINES,
    GAZEBO,
    MUJOCO,
    PLANAR,
    TREATMENTS,
    completions,
    controls,
    endings,
    outvoted,
    rank_engines,
    rank_pair,
    rank_with_planar,
)
from series import Series, random_designs

from evoros.fitness.equation_one import equation_one
from evoros.storage.tables import read_outcomes

PLANAR_TRIALS = 5  # for each seed: the first with the engines' draws, the others with fresh draws
CONTROLS = {
    "planar-5ms": ("simulator=planar", "simulator.time_step=0.005"),
    "pybullet-10ms": ("simulator=pybullet", "simulator.time_step=0.01"),
    "mujoco-5ms": ("simulator=mujoco", "simulator.time_step=0.005"),
    "gazebo-4ms": ("simulator=gazebo", "simulator.time_step=0.004"),
}
"""The same simulators with another step, which should not matter; without failures."""


def all_series(trials: int) -> Iterator[Series]:
    """Yield the series in the order in which they run, so that an early end leaves fewer trials."""
    for seed in range(trials):
        for treatment in TREATMENTS:
            yield Series(PLANAR, treatment, seed, ("simulator=planar", f"trials={PLANAR_TRIALS}"))
            for engine in ENGINES:
                yield Series(engine, treatment, seed, (f"simulator={engine}", "trials=1"))
    for seed in range(trials):
        for name, overrides in CONTROLS.items():
            yield Series(name, "none", seed, (*overrides, "trials=1"))


def read_missions(study: Path, series: Sequence[Series]) -> pd.DataFrame:
    """All missions of the finished series, each with its score by Eq. 1."""
    missions = pd.concat([part.missions(study) for part in series if part.finished(study)])
    rows = cast(list[dict[str, str]], missions.to_dict("records"))
    typed = missions.assign(
        score=[equation_one(read_outcomes(row)[0]) for row in rows],
        design=missions.design.astype(int),
        completed=missions.completed == "true",
        progress=missions.progress.astype(float),
    )
    return typed.reset_index(drop=True)


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
    means = [rank_with_planar(missions, engine) for engine in ENGINES]
    pairs = rank_engines(missions)
    rank_pair(missions, MUJOCO, GAZEBO)
    for first, second in combinations((*ENGINES, PLANAR), 2):
        completions(missions, first, second)
        endings(missions, first, second)
    outvoted(missions)
    controls(missions, (*ENGINES, PLANAR, *CONTROLS))
    figure(dict(zip(ENGINES, means, strict=True)))
    if pairs:
        figure_of_pairs(pairs)


if __name__ == "__main__":
    main()
