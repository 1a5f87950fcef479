"""Measures how hard the worlds are by the random designs that complete each of them, and all.

Runs random designs of the configured design space in each world. All designs meet the same draws;
with ``trials=3``, each design has three trials:

    python benchmarks/studies/random_designs.py [designs] [override ...]
"""

import sys

import numpy as np

import evoros
from evoros.base.rng import generator


def main(count: int, overrides: list[str]) -> None:
    with evoros.Evaluator(overrides) as evaluator:
        rng = generator("0", "random_designs")
        space = evaluator.space
        designs = [space.decode(rng.random(space.size)) for _ in range(count)]
        missions = evaluator.missions(designs)
    completed = missions.pivot_table(
        index=["design", "trial"], columns="world", values="completed", aggfunc="all"
    ).astype(bool)
    print(f"{count} random designs, {len(completed) // count} missions each in each world")
    for world in completed:
        rows = missions[missions.world == world]
        ended = ", ".join(f"{n} {how}" for how, n in rows.ended.value_counts().items())
        print(
            f"{world:10s} completed by {completed[world].mean():6.1%}   progress "
            f"{rows.progress.mean():.2f}   time {rows.time_s.mean():.0f} s   ({ended})"
        )
    print(f"{'all':10s} completed by {completed.all(axis=1).mean():6.1%}")
    times = missions.groupby("design").time_s.sum()
    print(f"simulated {np.sum(times):.0f} s")


if __name__ == "__main__":
    main(
        int(sys.argv[1]) if len(sys.argv) > 1 else 60,
        sys.argv[2:],
    )
