"""The memory of several missions as one block of bytes, which is copied to a device and back.

Arrays that overlap here overlap there, so that views remain views.
"""

from collections.abc import Iterator, Mapping, Sequence
from ctypes import memmove
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from evoros.compilation.device import Memory
from evoros.compilation.records import find_addresses, list_words
from evoros.mission.inputs import FilterStage, LayerStage, LoopCall, LoopResult
from evoros.mission.kernel_loop import RECORDS, Ending, list_row_addresses
from evoros.mission.stage_tables import KERNEL_STAGES, tabulate

_ALIGNED = 16  # bytes
_WORD_BITS = 64
GIVEN, KEPT, FILLED = range(3)
"""Groups of pieces, in this order: only copied to the device; copied back, too; trajectories, which
are only copied back."""

Words = NDArray[np.int64]


class _Pieces:
    """Pieces of this process's memory, and where each lies in the image."""

    def __init__(self) -> None:
        self._spans: list[tuple[int, int, int]] = []

    def add(self, array: NDArray[Any], group: int = GIVEN) -> None:
        if array.nbytes:
            start = _address(array)
            self._spans.append((start, start + array.nbytes, group))

    def arrange(self) -> None:
        """Join spans that overlap, and put the pieces of each group one after another."""
        pieces: list[list[int]] = []
        for start, end, group in sorted(self._spans):
            if pieces and start < pieces[-1][1]:
                pieces[-1][1:] = max(end, pieces[-1][1]), max(group, pieces[-1][2])
            else:
                pieces.append([start, end, group])
        starts, ends, groups = np.array(pieces, dtype=np.int64).reshape(-1, 3).T
        sizes = -(-(ends - starts) // _ALIGNED) * _ALIGNED
        order = np.argsort(groups, kind="stable")
        self.offsets = np.empty_like(starts)
        self.offsets[order] = np.cumsum(sizes[order]) - sizes[order]
        self.starts, self.lengths, self.groups = starts, ends - starts, groups
        self.bounds = [0, *(int(sizes[groups <= group].sum()) for group in (GIVEN, KEPT, FILLED))]

    def find(self, addresses: Words) -> Words:
        """Return where in the image addresses lie; those of empty arrays lie anywhere."""
        piece = np.searchsorted(self.starts, addresses, side="right") - 1
        return addresses - self.starts[piece] + self.offsets[piece]

    def list(self, groups: Sequence[int]) -> Iterator[tuple[int, int, int]]:
        """Yield the address, the place in the image and the length of each piece of groups."""
        chosen = np.isin(self.groups, groups)
        columns = (self.starts[chosen], self.offsets[chosen], self.lengths[chosen])
        yield from zip(*(column.tolist() for column in columns), strict=True)


class Image:
    """The memory of missions whose rules have numbers.

    ``size`` is that of all bytes; the rows of the missions begin at ``rows``.
    """

    def __init__(self, calls: Sequence[LoopCall], numbers: Mapping[Any, int]) -> None:
        self._calls, self._numbers = calls, numbers
        self._pieces, self._states = _Pieces(), dict[int, Words]()
        self._tables: list[tuple[Words, list[int]]] = []
        self._endings = np.zeros((len(calls), len(LoopResult._fields)))
        self._pieces.add(self._endings, KEPT)
        rows = [self._add(call, self._endings[i]) for i, call in enumerate(calls)]
        self._rows = np.array(rows, dtype=np.int64)
        self._pieces.add(self._rows)
        self._pieces.arrange()
        self.size = self._pieces.bounds[-1]
        self.rows = int(self._pieces.find(np.array([_address(self._rows)]))[0])

    def write(self, memory: Memory) -> None:
        """Copy to the memory of a device what the missions start with."""
        content = np.empty(self._pieces.bounds[2], dtype=np.uint8)
        for table, addresses in (*self._tables, (self._rows, _ROW_ADDRESSES)):
            table[:, addresses] = memory.address + self._pieces.find(table[:, addresses])
        base = _address(content)
        for start, offset, length in self._pieces.list((GIVEN, KEPT)):
            memmove(base + offset, start, length)
        memory.write(content)

    def read(self, memory: Memory) -> list[LoopResult]:
        """Copy back what the missions have done, and return their results."""
        first = self._pieces.bounds[1]
        content = memory.read(first, self._pieces.bounds[2])
        base = _address(content) - first
        for start, offset, length in self._pieces.list((KEPT,)):
            memmove(start, base + offset, length)
        results = [LoopResult(int(k), int(n), bool(fine)) for k, n, fine in self._endings.tolist()]
        for call, result in zip(self._calls, results, strict=True):
            rows = call.arrays.trajectory[: result.rows]
            if rows.nbytes:
                start = int(self._pieces.find(np.array([_address(rows)]))[0])
                written = memory.read(start, start + rows.nbytes)
                memmove(_address(rows), _address(written), rows.nbytes)
        return results

    def _add(self, call: LoopCall, ending: NDArray[Any]) -> list[int]:
        """Add the arrays of a mission, and return the words of its row."""
        inputs, agents, timing, arrays = call
        tables = {
            "filters": self._tabulate(FilterStage, inputs.filters),
            "localization": self._tabulate(FilterStage, inputs.localization),
            "layers": self._tabulate(LayerStage, inputs.layers),
            "actuation": self._tabulate(FilterStage, inputs.actuation),
        }
        inputs = inputs._replace(**tables)  # type: ignore[arg-type]
        for array in (inputs.parameters, inputs.memory, arrays.routes, *agents):
            self._pieces.add(array)
        for array in arrays:
            self._pieces.add(array, KEPT)
        self._pieces.add(arrays.trajectory, FILLED)
        records = zip(
            RECORDS.values(), (inputs, agents, timing, arrays, Ending(ending)), strict=True
        )
        return [word for kind, record in records for word in list_words(kind, record, self._name)]

    def _tabulate(self, kind: Any, stages: Sequence[FilterStage | LayerStage]) -> Words:
        for stage in stages:
            for value in stage:
                if isinstance(value, np.ndarray):
                    self._pieces.add(value)
        table = tabulate(kind, stages, self._name)
        self._tables.append((table, _STAGE_ADDRESSES[kind]))
        self._pieces.add(table)
        return table

    def _name(self, value: Any) -> int:
        """Return the number of a rule, or the address of a generator's state."""
        if not isinstance(value, Generator):
            return self._numbers[value]
        key = id(value.bit_generator)
        if key not in self._states:
            self._states[key] = copy_state(value)
            self._pieces.add(self._states[key])
        return _address(self._states[key])


def copy_state(rng: Generator) -> Words:
    """Return the state of a generator of PCG64 as the six words that kernels have."""
    state: Any = rng.bit_generator.state
    numbers = state["state"]["state"], state["state"]["inc"]
    words = [part for number in numbers for part in divmod(number, 1 << _WORD_BITS)[::-1]]
    words += [state["has_uint32"], state["uinteger"]]
    return np.array(words, dtype=np.uint64).view(np.int64)


def _address(array: NDArray[Any]) -> int:
    return int(array.__array_interface__["data"][0])


_STAGE_ADDRESSES = {kind: find_addresses(record) for kind, record in KERNEL_STAGES.items()}
_ROW_ADDRESSES = list_row_addresses()
