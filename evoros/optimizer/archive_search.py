"""Quality-diversity searches, which keep an elite in each cell of a grid."""

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.random import Generator

from evoros.base.checks import COUNT
from evoros.base.errors import InputError
from evoros.optimizer.history import FitnessSearch, Sampler
from evoros.optimizer.library import draw_seed
from evoros.optimizer.protocol import Candidate, Goals, Individual, Score, Space

if TYPE_CHECKING:
    from ribs.archives import GridArchive

MOST_CELLS = 1_000_000
CELLS = replace(COUNT, limit=MOST_CELLS)


def create_archive(
    space: Space, goals: Goals, cells: int, rng: Generator, **settings: Any
) -> "GridArchive":
    """Create an archive of ``cells`` along each descriptor; outliers go to the edge cells.

    Raises:
        InputError: there are no descriptors, or too many cells.
    """
    from ribs.archives import GridArchive

    count = len(goals.descriptors)
    if not count:
        raise InputError(
            "descriptors: must have at least one measure that divides the archive, not none; "
            "add for example +measure@descriptors.front=front_coverage"
        )
    if cells**count > MOST_CELLS:
        raise InputError(
            f"optimizer.cells: must give an archive of at most {MOST_CELLS} cells, not "
            f"{cells} to the power of {count} descriptors; lower it, or remove descriptors"
        )
    return GridArchive(
        solution_dim=space.size,
        dims=[cells] * count,
        ranges=list(goals.descriptors.values()),
        seed=draw_seed(rng),
        extra_fields={"id": ((), np.int64)},
        **settings,
    )


class ArchiveSearch(FitnessSearch):
    """A search that keeps a sampler's best proposal in each cell of an archive."""

    def __init__(self, archive: "GridArchive", sampler: Sampler) -> None:
        super().__init__(sampler, "initial")
        self._archive = archive

    def tell(self, scores: Mapping[int, Score]) -> list[Candidate]:
        """Return the rows of the scored individuals and of the best; elites have ``survived`` 1.

        Raises:
            InputError: a score is missing, or has NaN.
        """
        changed = self._history.tell(scores)
        self._fill(changed)
        elites = [individual.id for individual in self.champions()]
        table = self._history.tabulate([*scores, *elites[:1]], elites)
        self._sampler.learn(self._history, changed)
        self._history.ask(self._sampler.propose(), self._sampler.name)
        return table

    def _fill(self, anew: bool) -> None:
        """Add this generation to the archive, or refill it with all individuals."""
        individuals = self._history.asked
        if anew:
            self._archive.clear()
            individuals = list(self._history.individuals.values())
        told = [self._history.scores[individual.id] for individual in individuals]
        self._archive.add(
            np.array([individual.genome for individual in individuals]),
            np.array([score.fitness for score in told]),
            np.array([score.descriptor for score in told]),
            id=np.array([individual.id for individual in individuals]),
        )

    def champions(self) -> list[Individual]:
        """Return the elites, the fittest first."""
        return self._history.rank(map(int, self._archive.data("id")))
