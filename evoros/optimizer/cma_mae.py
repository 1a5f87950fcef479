"""CMA-MAE: CMA-ES that improves an archive whose thresholds rise slowly."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import COUNT, FRACTION, PROBABILITY, checked, invalid
from evoros.base.errors import require_extra
from evoros.optimizer.cma_es import FEW
from evoros.optimizer.history import CELLS, ArchiveSearch, History, create_archive, draw_seed
from evoros.optimizer.protocol import BundledOptimizer, Goals, Search, Space, require_genes

if TYPE_CHECKING:
    from ribs.schedulers import Scheduler

MARGIN = 1e-9  # margin by which the first generation exceeds the initial thresholds


@dataclass(frozen=True)
@checked
class CmaMae(BundledOptimizer):
    """Covariance matrix adaptation MAP-annealing, from the package ``ribs``.

    Several strategies propose designs in each generation, searching for a fitness above the
    threshold of the design's cell. A threshold starts at the worst fitness of the first generation,
    and rises by ``learning_rate`` times the excess. A rate of 0 amounts to CMA-ES on the fitness;
    at a rate of 1, a strategy leaves a cell as soon as the cell has a good elite. Genes outside
    their range are reflected back into the range. See M. Fontaine and S. Nikolaidis, "Covariance
    Matrix Adaptation MAP-Annealing", GECCO 2023, arXiv:2205.10752.
    """

    population_size: Annotated[int, COUNT] = 32
    cells: Annotated[int, CELLS] = 10  # number of cells along each descriptor
    strategies: Annotated[int, COUNT] = 2
    sigma: Annotated[float, FRACTION] = 0.2  # initial standard deviation, relative to the ranges
    learning_rate: Annotated[float, PROBABILITY] = 0.1
    packages = ("ribs",)

    def __post_init__(self) -> None:
        minimum = FEW * self.strategies
        if self.population_size % self.strategies or self.population_size < minimum:
            rule = f"must be a multiple of strategies ({self.strategies}), at least {minimum}"
            raise invalid(self, "population_size", self.population_size, rule)

    def start(self, space: Space, goals: Goals, rng: Generator) -> Search:
        require_genes(space)
        with require_extra("search", "optimizer=cma_mae"):
            from ribs.emitters import EvolutionStrategyEmitter
            from ribs.schedulers import Scheduler

        annealing = {"learning_rate": float(self.learning_rate), "threshold_min": -MARGIN}
        thresholds = create_archive(space, goals, self.cells, rng, **annealing)
        emitters = [
            EvolutionStrategyEmitter(
                thresholds,
                x0=np.full(space.size, 0.5),
                sigma0=self.sigma,
                ranker="imp",
                selection_rule="mu",
                restart_rule="basic",
                batch_size=self.population_size // self.strategies,
                seed=draw_seed(rng),
            )
            for _ in range(self.strategies)
        ]
        archive = create_archive(space, goals, self.cells, rng)
        return ArchiveSearch(archive, _Strategies(Scheduler(thresholds, emitters)))


class _Strategies:
    name = "cma_mae"

    def __init__(self, scheduler: "Scheduler") -> None:
        self._scheduler = scheduler
        self._worst: float | None = None  # worst fitness of the first generation

    def propose(self) -> list[Array]:
        folded = self._scheduler.ask() % 2.0
        return list(np.minimum(folded, 2.0 - folded))  # reflects at 0 and 1

    def learn(self, history: History, changed: bool) -> None:
        fitness = np.array(history.fitness)
        if self._worst is None:
            self._worst = float(fitness.min())
        self._scheduler.tell(
            fitness - self._worst,
            np.array([history.scores[individual.id].descriptor for individual in history.asked]),
            id=np.array([individual.id for individual in history.asked]),
        )
