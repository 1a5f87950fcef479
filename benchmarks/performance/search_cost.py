"""Measures the time of each search for an ask and a tell of 100 individuals.

python benchmarks/performance/search_cost.py

The space is the case study's. The time is the median over the generations after the first
two, which load libraries and compile.
"""

from statistics import median
from time import perf_counter

import numpy as np

from evoros.config.compose import compose
from evoros.evolution.experiment import Experiment
from evoros.optimizer.protocol import Score

INDIVIDUALS, GENERATIONS, FIRST = 100, 10, 2
OPTIMIZERS = (
    "ga",
    "random_search",
    "sobol",
    "cma_es",
    "cat_cma",
    "tpe",
    "map_elites",
    "cma_mae",
    "nsga2",
)


def measure(experiment: Experiment) -> tuple[float, float]:
    """Return the median time [ms] of a generation, and its share for an individual."""
    search, rng = experiment.start_search(), np.random.default_rng(0)
    times, counts = [], []
    for _ in range(GENERATIONS):
        begun = perf_counter()
        asked = search.ask()
        spent = perf_counter() - begun
        scores = {
            one.id: Score(float(rng.random()), tuple(rng.random(2)), tuple(rng.random(2)))
            for one in asked
        }
        begun = perf_counter()
        search.tell(scores)
        times.append(1000 * (spent + perf_counter() - begun))
        counts.append(len(asked))
    return median(times[FIRST:]), median(
        time / count for time, count in zip(times[FIRST:], counts[FIRST:], strict=True)
    )


def main() -> None:
    print("| `optimizer=` | generation [ms] | individual [ms] |")
    print("|---|---|---|")
    for name in OPTIMIZERS:
        size = f"optimizer.population_size={INDIVIDUALS}"
        time, share = measure(compose([f"optimizer={name}", size, "simulator=planar"]).build())
        print(f"| `{name}` | {time:.2g} | {share:.2g} |", flush=True)


if __name__ == "__main__":
    main()
