"""CatCMA with margin, for mixed continuous, integer and categorical genes."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import checked
from evoros.base.errors import require_extra
from evoros.optimizer.cma_es import POPULATION, Strategies
from evoros.optimizer.history import FitnessSearch, draw_seed, list_categories, place_level
from evoros.optimizer.protocol import BundledOptimizer, Goals, Search, Space, require_genes

if TYPE_CHECKING:
    from cmaes import CatCMAwM


@dataclass(frozen=True)
@checked
class CatCma(BundledOptimizer):
    """CatCMA with margin, from the package ``cmaes``.

    Regions and sensor types are categorical, sensor counts and other whole numbers are integers,
    and all other genes are continuous. The search restarts after convergence. See R. Hamano et al.,
    "CatCMA with Margin: Stochastic Optimization for Continuous, Integer, and Categorical
    Variables", GECCO 2025, arXiv:2504.07884.
    """

    population_size: Annotated[int, POPULATION] = 16
    packages = ("cmaes",)

    def start(self, space: Space, goals: Goals, rng: Generator) -> Search:
        require_genes(space)
        with require_extra("search", "optimizer=cat_cma"):
            from cmaes import CatCMAwM

        genes = _Genes.of(space)

        def begin() -> Iterator[CatCMAwM]:
            while True:
                yield CatCMAwM(
                    x_space=[[0.0, 1.0]] * len(genes.continuous) or None,
                    z_space=[list(range(count)) for count in genes.numbers.values()] or None,
                    c_space=list(genes.categories.values()) or None,
                    population_size=self.population_size,
                    seed=draw_seed(rng),
                )

        converging = len(genes.categories) < space.size
        strategies = ("cat_cma", self.population_size, begin(), genes.compose, converging)
        return FitnessSearch(Strategies(*strategies))


@dataclass(frozen=True)
class _Genes:
    size: int
    continuous: list[int]
    numbers: dict[int, int]
    categories: dict[int, int]

    @classmethod
    def of(cls, space: Space) -> "_Genes":
        categories = {i: space.levels[i] for i in list_categories(space) if i in space.levels}
        numbers = {i: count for i, count in sorted(space.levels.items()) if i not in categories}
        known = {*numbers, *categories}
        continuous = [i for i in range(space.size) if i not in known]
        return cls(space.size, continuous, numbers, categories)

    def compose(self, solution: "CatCMAwM.Solution") -> Array:
        genome = np.zeros(self.size)
        if self.continuous:
            genome[self.continuous] = solution.x
        if self.numbers:
            counts = np.array(list(self.numbers.values()))
            genome[list(self.numbers)] = place_level(solution.z, counts)
        if self.categories:
            counts = np.array(list(self.categories.values()))
            genome[list(self.categories)] = place_level(solution.c.argmax(axis=1), counts)
        return genome
