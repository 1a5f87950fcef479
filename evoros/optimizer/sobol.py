"""A scrambled Sobol' sequence, which covers the space more evenly than random designs."""

from dataclasses import dataclass
from itertools import count, islice
from typing import Annotated

from numpy.random import Generator
from scipy.stats import qmc

from evoros.base.arrays import Array
from evoros.base.checks import COUNT, checked
from evoros.base.errors import InputError
from evoros.optimizer.history import FitnessSearch, FixedSampler
from evoros.optimizer.protocol import BundledOptimizer, Goals, Search, Space

BLOCK = 512  # number of points per draw; a power of two keeps the sequence balanced
MOST_GENES: int = qmc.Sobol.MAXDIM


@dataclass(frozen=True)
@checked
class Sobol(BundledOptimizer):
    """Evaluates the designs of a scrambled Sobol' sequence in order; keeps the best.

    Sobol', USSR Comput. Math. Math. Phys. 7 (4), 1967; Owen, J. Complexity 14 (4), 1998.
    """

    population_size: Annotated[int, COUNT] = 16
    packages = ("scipy",)

    def start(self, space: Space, goals: Goals, rng: Generator) -> Search:
        if space.size > MOST_GENES:
            raise InputError(
                f"design: must have at most {MOST_GENES} genes for optimizer=sobol, not "
                f"{space.size}; choose optimizer=random_search"
            )
        sequence = qmc.Sobol(max(1, space.size), scramble=True, rng=rng)
        points = (point[: space.size] for _ in count() for point in sequence.random(BLOCK))

        def propose() -> list[Array]:
            return list(islice(points, self.population_size))

        return FitnessSearch(FixedSampler("sobol", propose))
