"""The record of scores of a run: values of all individuals, and the best for a final choice."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from evoros.base.arrays import Array
from evoros.certificate.final_choice import FinalChoice
from evoros.optimizer.protocol import Individual

ROWS = 4096
"""Rows of a block."""


class NumberLog:
    """Rows of ``width`` numbers, each of an individual, in the order in which they were added.

    A row takes 8 bytes and 8 for each number, so that runs may have any number of individuals. The
    rows are in blocks, because one array that grows leaves holes in memory, as large as itself. In
    return, finding rows reads all of them, a few milliseconds for each million.
    """

    def __init__(self, width: int) -> None:
        self._width = width
        self._blocks: list[tuple[NDArray[np.int64], Array]] = []  # individuals and numbers
        self._used = ROWS  # of the last block

    def add(self, individual: int, row: Sequence[float]) -> None:
        """Add a row of ``width`` numbers."""
        if len(row) != self._width:
            raise ValueError(f"a row must have {self._width} numbers, not {len(row)}")
        if self._used == ROWS:
            self._blocks.append((np.empty(ROWS, np.int64), np.empty((ROWS, self._width))))
            self._used = 0
        ids, numbers = self._blocks[-1]
        ids[self._used], numbers[self._used] = individual, row
        self._used += 1

    def find(self, individuals: Iterable[int]) -> dict[int, list[list[float]]]:
        """Return the rows of each of these individuals; an empty list for one without rows."""
        rows: dict[int, list[list[float]]] = {i: [] for i in individuals}
        wanted = np.array(sorted(rows), dtype=np.int64)
        for index, (ids, numbers) in enumerate(self._blocks, 1):
            used = ids[: self._used] if index == len(self._blocks) else ids
            # Most blocks have none of the ids, which rise.
            near = wanted[(wanted >= used.min()) & (wanted <= used.max())]
            for place in np.flatnonzero(np.isin(used, near)).tolist() if len(near) else ():
                rows[int(ids[place])].append(numbers[place].tolist())
        return rows

    def find_last(self, individuals: Iterable[int]) -> dict[int, list[float]]:
        """Return the last row of each of these individuals, which must have one."""
        return {i: rows[-1] for i, rows in self.find(individuals).items()}


class Ledger:
    """The scores of a run's individuals so far, by their id."""

    def __init__(self, measures: int, final_choice: FinalChoice | None) -> None:
        self._final_choice = final_choice
        self._screened = NumberLog(1)  # the score of a trial in the run's own simulator
        self._told = NumberLog(1 + measures)  # as the search was told: fitness and measures
        self._shown = NumberLog(2)  # the generation and the number of trials before it
        self.finalists: dict[int, Individual] = {}
        """The best so far, and those whose fitness may change; empty without a final choice."""

    def add_screened(self, scores: Mapping[int, Sequence[float]]) -> None:
        """Add the scores of further trials."""
        for design_id, of_trials in scores.items():
            for score in of_trials:
                self._screened.add(design_id, [score])

    def find_screened(self, individuals: Iterable[int]) -> dict[int, list[float]]:
        """Return the scores of all trials of each of these individuals."""
        by_id = self._screened.find(individuals)
        return {i: [score for (score,) in rows] for i, rows in by_id.items()}

    def add_told(self, individual: int, fitness: float, measures: Sequence[float]) -> None:
        """Add the values that the search is told of an individual."""
        self._told.add(individual, [fitness, *measures])

    def find_told(self, individuals: Iterable[int]) -> dict[int, list[float]]:
        """Return the fitness and the measures of individuals, as the search was told last."""
        return self._told.find_last(individuals)

    def find_fitness(self, individuals: Iterable[int]) -> dict[int, float]:
        """Return the fitness of individuals, as the search was told last."""
        return {i: row[0] for i, row in self.find_told(individuals).items()}

    def show(self, individual: int, generation: int, earlier: int) -> None:
        """Note that an individual, as a champion, shows its trials of this generation.

        ``earlier`` is the number of its trials in generations before.
        """
        self._shown.add(individual, (generation, earlier))

    def find_shown(self, individual: int) -> tuple[int, int]:
        """Return the generation and the number of earlier trials as ``show`` noted them last."""
        generation, earlier = self._shown.find_last([individual])[individual]
        return int(generation), int(earlier)

    def keep_finalists(self, alive: Iterable[Individual]) -> None:
        """Keep the individuals that a final choice may need; ``alive`` ones may yet change.

        The fitness of all others is final. If one is not among the best of them now, it never will
        be.
        """
        if self._final_choice is None:
            return
        living = {individual.id: individual for individual in alive}
        known = self.finalists | living
        ended = self.find_fitness(known.keys() - living.keys())
        kept = living.keys() | set(self._final_choice.find_finalists(ended))
        self.finalists = {i: individual for i, individual in known.items() if i in kept}
