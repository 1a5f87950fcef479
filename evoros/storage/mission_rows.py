"""The offsets of recorded mission rows, and the outcomes of a few rows in memory."""

from array import array
from collections.abc import Callable, Iterator, Sequence

from evoros.mission.mission import MissionKey
from evoros.mission.outcome import Outcomes
from evoros.mission.plan import MOST_REPEATS

Recorded = tuple[MissionKey, str, Outcomes]
"""The key of a mission, its conditions, and its outcomes."""
GENERATION, DESIGN = 0, 1
"""Indices, in a mission's key, of the parts that can form groups."""


class MissionRows:
    """The offsets of mission rows, and the outcomes of the current group of rows.

    A mission needs 9 bytes of memory. ``read_row`` reads the row at an offset in ``missions.csv``.
    Rows of a group share the part ``group`` of their keys: the generation in a search, the design
    in an evaluation.
    """

    def __init__(self, read_row: Callable[[int], Recorded], group: int = GENERATION) -> None:
        self._read_row, self._group = read_row, group
        self.worlds: set[str] = set()  # names of worlds with missions
        self.trials = 0  # maximum per world, without missions under stated conditions
        self._places: dict[int, array[int]] = {}  # offsets by group
        self._wanted: dict[int, bytearray] = {}  # 1 for each requested row
        self._in_use = -1  # current group
        self._outcomes: dict[MissionKey, tuple[str, Outcomes]] = {}  # rows of the current group
        self._ranks: dict[MissionKey, int] = {}  # indices of these rows

    def __len__(self) -> int:
        return sum(map(len, self._places.values()))

    def find(self, key: MissionKey) -> tuple[str, Outcomes] | None:
        """Return the conditions and the outcomes of a mission; None if it is not recorded."""
        group = self._find_group(key)
        if group != self._in_use:
            rows = map(self._read_row, self._places.get(group, ()))
            self._outcomes = {key: (draws, outcomes) for key, draws, outcomes in rows}
            self._ranks = {key: rank for rank, key in enumerate(self._outcomes)}
            self._in_use = group
        if key in self._ranks:
            self._wanted[group][self._ranks[key]] = True
        return self._outcomes.get(key)

    def find_unwanted(self) -> Iterator[int]:
        """Yield the offsets of rows that were not requested."""
        for group, places in self._places.items():
            wanted = self._wanted[group]
            yield from (place for place, asked in zip(places, wanted, strict=True) if not asked)

    def note(self, key: MissionKey, place: int) -> None:
        """Store the offset of a row that was read."""
        *_, world, trial = key
        group = self._find_group(key)
        self.worlds.add(world)
        if trial < MOST_REPEATS:
            self.trials = max(self.trials, trial + 1)
        self._places.setdefault(group, array("q")).append(place)
        self._wanted.setdefault(group, bytearray()).append(False)

    def add(self, rows: Sequence[Recorded], places: Sequence[int]) -> None:
        """Add rows that were just written, at their offsets."""
        for (key, draws, outcomes), place in zip(rows, places, strict=True):
            self.note(key, place)
            group = self._find_group(key)
            self._wanted[group][-1] = True
            if group == self._in_use:
                self._outcomes[key] = (draws, outcomes)
                self._ranks[key] = len(self._ranks)

    def _find_group(self, key: MissionKey) -> int:
        generation, design, *_ = key
        return design if self._group == DESIGN else generation
