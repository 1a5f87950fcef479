"""CMA-ES, which adapts a normal distribution of genomes to the fitness."""

import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import COUNT, FLAG, FRACTION, checked, is_whole
from evoros.base.errors import require_extra
from evoros.optimizer.history import FitnessSearch, History, draw_seed
from evoros.optimizer.protocol import BundledOptimizer, Goals, Search, Space, require_genes

FEW = 4
POPULATION = replace(
    COUNT,
    text=f"an integer >= {FEW} (at least two designs must guide the search)",
    holds=lambda v: is_whole(v) and v >= FEW,
)


@dataclass(frozen=True)
@checked
class CmaEs(BundledOptimizer):
    """The covariance matrix adaptation evolution strategy, from the package ``cmaes``.

    All genes are treated as continuous; ``CatCma`` is better suited to regions and whole numbers.
    The search starts at the centre of the space, and restarts at a random point after convergence.
    With ``adapt_rates``, it lowers the learning rates as far as the noise of the fitness requires.
    See N. Hansen, "The CMA Evolution Strategy: A Tutorial", arXiv:1604.00772; M. Nomura, Y. Akimoto
    and I. Ono, "CMA-ES with Learning Rate Adaptation", GECCO 2023, arXiv:2304.03473.
    """

    population_size: Annotated[int, POPULATION] = 16
    sigma: Annotated[float, FRACTION] = 0.3  # initial standard deviation, relative to the ranges
    adapt_rates: Annotated[bool, FLAG] = False
    packages = ("cmaes",)

    def start(self, space: Space, goals: Goals, rng: Generator) -> Search:
        require_genes(space)
        with require_extra("search", "optimizer=cma_es"):
            from cmaes import CMA

        def begin() -> Iterator[CMA]:
            mean = np.full(space.size, 0.5)
            while True:
                yield CMA(
                    mean=mean,
                    sigma=self.sigma,
                    bounds=np.tile([0.0, 1.0], (space.size, 1)),
                    seed=draw_seed(rng),
                    population_size=self.population_size,
                    lr_adapt=self.adapt_rates,
                )
                mean = rng.random(space.size)

        return FitnessSearch(Strategies("cma_es", self.population_size, begin(), np.asarray))


@dataclass
class Strategies:
    """A sequence of strategies from the package ``cmaes``, each used until it converges."""

    name: str
    population_size: int
    strategies: Iterator[Any]
    compose: Callable[[Any], Array]  # returns the genome (size,) of a solution
    converging: bool = True

    def __post_init__(self) -> None:
        self._strategy = next(self.strategies)

    def propose(self) -> list[Array]:
        """Return the genomes of the next generation."""
        self._solutions = [self._strategy.ask() for _ in range(self.population_size)]
        return list(map(self.compose, self._solutions))

    def learn(self, history: History, changed: bool) -> None:
        """Update the strategy with the fitness of the generation."""
        costs = [-fitness for fitness in history.fitness]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # numpy warns if all values are equal
            self._strategy.tell(list(zip(self._solutions, costs, strict=True)))
        if self.converging and self._strategy.should_stop():
            self._strategy = next(self.strategies)
