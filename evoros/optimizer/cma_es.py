"""CMA-ES, which adapts a normal distribution to the fitness."""

import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import COUNT, FLAG, POSITIVE, WHOLE, Rule, checked, is_whole
from evoros.optimizer.fitness_search import FitnessSearch
from evoros.optimizer.history import History
from evoros.optimizer.library import draw_seed, require_library
from evoros.optimizer.protocol import Goals, Search, Space, require_genes

if TYPE_CHECKING:
    from cmaes import CMA

FEW = 4
POPULATION = replace(
    COUNT,
    text=f"a whole number of at least {FEW}, of which the better half is learned from",
    holds=lambda v: is_whole(v) and v >= FEW,
)
STEP = Rule("a number greater than 0, at most 1", lambda v: POSITIVE.holds(v) and v <= 1)


@dataclass(frozen=True)
@checked
class CmaEs:
    """The covariance matrix adaptation evolution strategy of the package ``cmaes``.

    All genes are continuous to it; ``CatCma`` knows of regions and numbers. It begins in the middle
    of the space, and when it has converged, again at a random place. With ``adapt_rates`` it
    lowers its learning rates as far as the noise of the fitness demands.

    N. Hansen, "The CMA Evolution Strategy: A Tutorial", arXiv:1604.00772; M. Nomura, Y. Akimoto and
    I. Ono, "CMA-ES with Learning Rate Adaptation", GECCO 2023, arXiv:2304.03473.
    """

    population_size: Annotated[int, POPULATION] = 16
    generations: Annotated[int, COUNT] = 25
    validation_trials: Annotated[int, WHOLE] = 5  # of each generation's best, on fresh draws
    sigma: Annotated[float, STEP] = 0.3  # standard deviation at first, as a share of the ranges
    adapt_rates: Annotated[bool, FLAG] = False
    packages = ("cmaes",)

    def start(self, space: Space, goals: Goals, rng: Generator) -> Search:
        """Start a search by fitness, whose generator is seeded by ``rng``.

        Raises:
            InputError: the space has no genes, or the package is not installed.
        """
        require_genes(space)
        with require_library("cma_es"):
            from cmaes import CMA

        def begin(mean: Array) -> CMA:
            return CMA(
                mean=mean,
                sigma=self.sigma,
                bounds=np.tile([0.0, 1.0], (len(mean), 1)),
                seed=draw_seed(rng),
                population_size=self.population_size,
                lr_adapt=self.adapt_rates,
            )

        return FitnessSearch(_Strategy(self.population_size, space.size, rng, begin))


class _Strategy:
    """The strategies of the package, one after another."""

    name = "cma_es"

    def __init__(
        self, population_size: int, size: int, rng: Generator, begin: Callable[[Array], "CMA"]
    ) -> None:
        self._population_size, self._size = population_size, size
        self._rng, self._begin = rng, begin
        self._strategy = begin(np.full(size, 0.5))

    def propose(self) -> list[Array]:
        self._points = [self._strategy.ask() for _ in range(self._population_size)]
        return self._points

    def learn(self, history: History, changed: bool) -> None:
        costs = [-fitness for fitness in history.fitness]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # of numpy, if all are equal
            self._strategy.tell(list(zip(self._points, costs, strict=True)))
        if self._strategy.should_stop():
            self._strategy = self._begin(self._rng.random(self._size))
