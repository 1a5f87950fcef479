"""What quality-diversity searches share: an archive of elites, one in each cell of a grid."""

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.random import Generator

from evoros.base.checks import COUNT
from evoros.base.errors import InputError
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


class Elites:
    """What a search has asked for, and the archive of the best in each cell."""

    def __init__(self, archive: "GridArchive") -> None:
        self.archive, self.history = archive, History()

    def tell(self, scores: Mapping[int, Score]) -> None:
        """Put the individuals that were asked for into the archive; all anew if scores changed.

        Raises:
            InputError: a score is missing, or has NaN.
        """
        individuals = self.history.asked
        if self.history.tell(scores):
            self.archive.clear()
            individuals = list(self.history.individuals.values())
        told = [self.history.scores[individual.id] for individual in individuals]
        self.archive.add(
            np.array([individual.genome for individual in individuals]),
            np.array([score.fitness for score in told]),
            np.array([score.descriptor for score in told]),
            id=np.array([individual.id for individual in individuals]),
        )

    def tabulate(self, scores: Mapping[int, Score]) -> list[Candidate]:
        """Return the rows of those told and of the best; ``survived`` is 1 for elites."""
        elites = [individual.id for individual in self.champions()]
        return self.history.tabulate([*scores, *elites[:1]], elites)

    def champions(self) -> list[Individual]:
        """Return the elites, the fittest first."""
        scores = self.history.scores
        numbers = map(int, self.archive.data("id"))
        ranked = sorted(numbers, key=lambda number: (-scores[number].fitness, number))
        return [self.history.individuals[number] for number in ranked]
