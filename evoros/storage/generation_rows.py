"""The outcomes of a run's missions, of which only one generation is kept in memory."""

from array import array
from collections.abc import Callable, Iterator, Sequence

from evoros.mission.mission import MissionKey
from evoros.mission.outcome import Outcomes

Recorded = tuple[MissionKey, str, Outcomes]
"""The key of a mission, its conditions, and its outcomes."""


class GenerationRows:
    """The places of each generation's rows, and the outcomes of the generation in use.

    A mission costs 9 bytes of memory, so that runs may have any number of them. ``read_row`` reads
    the row at a place in the table of missions.
    """

    def __init__(self, read_row: Callable[[int], Recorded]) -> None:
        self._read_row = read_row
        self.worlds: set[str] = set()  # that the missions are in
        self._places: dict[int, array[int]] = {}  # in the table, by the generation
        self._wanted: dict[int, bytearray] = {}  # whether each has been asked for
        self._generation = -1  # in use
        self._outcomes: dict[MissionKey, tuple[str, Outcomes]] = {}  # of it
        self._ranks: dict[MissionKey, int] = {}  # of its rows

    def __len__(self) -> int:
        return sum(map(len, self._places.values()))

    def find(self, key: MissionKey) -> tuple[str, Outcomes] | None:
        """Return the conditions and the outcomes of a mission; None if it has no row."""
        generation = key[0]
        if generation != self._generation:
            rows = map(self._read_row, self._places.get(generation, ()))
            self._outcomes = {key: (draws, outcomes) for key, draws, outcomes in rows}
            self._ranks = {key: rank for rank, key in enumerate(self._outcomes)}
            self._generation = generation
        if key in self._ranks:
            self._wanted[generation][self._ranks[key]] = True
        return self._outcomes.get(key)

    def find_unwanted(self) -> Iterator[int]:
        """Yield the places of the rows for which nobody has asked."""
        for generation, places in self._places.items():
            wanted = self._wanted[generation]
            yield from (place for place, asked in zip(places, wanted, strict=True) if not asked)

    def note(self, key: MissionKey, place: int) -> None:
        """Note the place of a row that has been read."""
        self.worlds.add(key[2])
        self._places.setdefault(key[0], array("q")).append(place)
        self._wanted.setdefault(key[0], bytearray()).append(False)

    def add(self, rows: Sequence[Recorded], places: Sequence[int]) -> None:
        """Add rows that have been written."""
        for (key, draws, outcomes), place in zip(rows, places, strict=True):
            self.note(key, place)
            self._wanted[key[0]][-1] = True
            if key[0] == self._generation:
                self._outcomes[key] = (draws, outcomes)
                self._ranks[key] = len(self._ranks)
