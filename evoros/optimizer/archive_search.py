"""Quality-diversity searches: an archive of elites, one in each cell of a grid."""

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.random import Generator

from evoros.base.checks import COUNT
from evoros.base.errors import InputError
from evoros.optimizer.fitness_search import Sampler
from evoros.optimizer.history import History
from evoros.optimizer.library import draw_seed
from evoros.optimizer.protocol import Candidate, Goals, Individual, Score, Space

if TYPE_CHECKING:
    from ribs.archives import GridArchive

MOST_CELLS = 1_000_000
CELLS = replace(COUNT, limit=MOST_CELLS)


def create_archive(
    space: Space, goals: Goals, cells: int, rng: Generator, **settings: Any
) -> "GridArchive":
    """Create an archive of ``cells`` along each descriptor; designs beyond go to its edges.

    Raises:
        InputError: there are no descriptors, or too many cells.
    """
    from ribs.archives import GridArchive

    count = len(goals.descriptors)
    if not count:
        raise InputError(
            "descriptors: must have at least one measure by which an archive is divided, not none; "
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


class ArchiveSearch:
    """A search that keeps the best proposal of a sampler in each cell of an archive."""

    def __init__(self, archive: "GridArchive", sampler: Sampler) -> None:
        self._archive, self._sampler, self._history = archive, sampler, History()
        self._history.ask(sampler.propose(), "initial")

    def ask(self) -> list[Individual]:
        """Return the individuals of this generation."""
        return self._history.asked

    def tell(self, scores: Mapping[int, Score]) -> list[Candidate]:
        """Return the rows of the individuals told and of the best; ``survived`` is 1 for elites.

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
        """Add this generation to the archive, or all individuals to an empty one."""
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
