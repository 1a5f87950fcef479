"""Numbers of a run's individuals, kept in little memory."""

from array import array
from collections.abc import Iterable, Sequence

import numpy as np


class NumberLog:
    """Rows of ``width`` numbers, each of an individual, in the order in which they were added.

    A row takes 8 bytes and 8 for each number, so that runs may have any number of individuals. In
    return, finding rows reads all of them, about a millisecond for each million.
    """

    def __init__(self, width: int) -> None:
        self._width = width
        self._ids, self._numbers = array("q"), array("d")

    def add(self, individual: int, row: Sequence[float]) -> None:
        """Add a row of ``width`` numbers."""
        if len(row) != self._width:
            raise ValueError(f"a row must have {self._width} numbers, not {len(row)}")
        self._ids.append(individual)
        self._numbers.extend(row)

    def find(self, individuals: Iterable[int]) -> dict[int, list[list[float]]]:
        """Return the rows of each of these individuals; an empty list for one without rows."""
        found: dict[int, list[list[float]]] = {number: [] for number in individuals}
        # Views of the arrays, which cannot grow as long as there are any.
        ids = np.frombuffer(self._ids, dtype=np.int64)
        numbers = np.frombuffer(self._numbers).reshape(-1, self._width)
        for place in np.flatnonzero(np.isin(ids, list(found))):
            found[int(ids[place])].append(numbers[place].tolist())
        return found

    def find_last(self, individuals: Iterable[int]) -> dict[int, list[float]]:
        """Return the last row of each of these individuals, which must have one."""
        return {number: rows[-1] for number, rows in self.find(individuals).items()}
