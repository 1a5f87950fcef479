"""Copies missions to a device as one block of memory, the image, on which a kernel runs."""

from collections.abc import Iterator, Mapping, Sequence
from ctypes import memmove
from functools import cache
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numba.extending import lower_builtin, type_callable
from numpy.random import Generator
from numpy.typing import NDArray

from evoros.base.arrays import Array
from evoros.compilation import machine_code
from evoros.compilation.device import Memory
from evoros.compilation.kernel import RULES, make_kernel_generator
from evoros.compilation.records import WORD, Reader, count_words, find_addresses, list_words
from evoros.compilation.rules import A1, I8
from evoros.mission.compiled_loop import (
    KERNEL_STAGES,
    KERNEL_TABLE,
    name_records,
    tabulate,
    tabulate_stages,
)
from evoros.mission.inputs import (
    Agents,
    Arrays,
    FilterStage,
    LayerStage,
    LoopCall,
    LoopInputs,
    LoopResult,
    Timing,
)
from evoros.mission.loop import run_loop

WORD_SIZE = 8  # bytes


class Ending(NamedTuple):
    """Memory in which a kernel stores the numbers of a mission's ``LoopResult``."""

    result: Array  # (3,)


_MOTION = RULES["observe"], RULES["sense"], RULES["advance"]

RECORDS = {**name_records(_MOTION, KERNEL_TABLE), Ending: types.NamedTuple((A1,), Ending)}
"""The numba types of the records in the row of a mission, in order."""

_SIZES = [WORD_SIZE * count_words(record) for record in RECORDS.values()]
ROW_SIZE = sum(_SIZES)  # bytes
_, AGENTS, TIMING, ARRAYS, ENDING, _ = accumulate(_SIZES, initial=0)
"""Offsets [bytes] of the second and later records in a row."""


def read_record(kind: Any, address: int) -> Any:
    """Return the record at an address; callable only from compiled code."""
    raise NotImplementedError


@type_callable(read_record)  # type: ignore[untyped-decorator]
def _type(context: Any) -> Any:
    return lambda kind, address: RECORDS[kind.instance_class]


@lower_builtin(read_record, types.NamedTupleClass, types.Integer)  # type: ignore[untyped-decorator]
def _read_record(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    place = builder.inttoptr(arguments[1], WORD.as_pointer())
    return Reader(context, builder, place, make_kernel_generator).read(signature.return_type)


def run_row(row: int) -> None:
    """Run the mission whose records start at the address ``row``."""
    result: LoopResult = run_loop(
        read_record(LoopInputs, row),
        read_record(Agents, row + AGENTS),
        read_record(Timing, row + TIMING),
        read_record(Arrays, row + ARRAYS),
    )
    ending = read_record(Ending, row + ENDING).result
    ending[0] = result.ticks
    ending[1] = result.rows
    ending[2] = 1.0 if result.finite else 0.0


@cache
def lower_loop() -> machine_code.Lowered:
    """Compile ``run_row`` for kernels."""
    signature = types.void(I8)
    machine_code.register(run_loop, run_loop, False)
    with machine_code.compiling() as on_disk:
        return machine_code.lower(
            machine_code.compile_function(run_row, signature, on_disk, **machine_code.BORROWING),
            signature,
        )


_ALIGNED = 16  # bytes
_WORD_BITS = 64
GIVEN, KEPT, FILLED = range(3)  # pieces copied to the device, both ways, or back (trajectories)

Words = NDArray[np.int64]


class _Pieces:
    def __init__(self) -> None:
        self._spans: list[tuple[int, int, int]] = []

    def add(self, array: NDArray[Any], group: int = GIVEN) -> None:
        if array.nbytes:
            start = _address(array)
            self._spans.append((start, start + array.nbytes, group))

    def arrange(self) -> None:
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
        """Return the image offset of each address; arbitrary for empty arrays."""
        piece = np.searchsorted(self.starts, addresses, side="right") - 1
        return addresses - self.starts[piece] + self.offsets[piece]

    def list(self, groups: Sequence[int]) -> Iterator[tuple[int, int, int]]:
        """Yield (address, image offset, length) for each piece in these groups."""
        chosen = np.isin(self.groups, groups)
        columns = (self.starts[chosen], self.offsets[chosen], self.lengths[chosen])
        yield from zip(*(column.tolist() for column in columns), strict=True)


class Image:
    """The image of several missions: its ``size`` [bytes] and the missions' offsets ``rows``."""

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
        """Copy the initial state of the missions to a device."""
        content = np.empty(self._pieces.bounds[2], dtype=np.uint8)
        for table, addresses in (*self._tables, (self._rows, _ROW_ADDRESSES)):
            table[:, addresses] = memory.address + self._pieces.find(table[:, addresses])
        base = _address(content)
        for start, offset, length in self._pieces.list((GIVEN, KEPT)):
            memmove(base + offset, start, length)
        memory.write(content)

    def read(self, memory: Memory) -> list[LoopResult]:
        """Copy back the arrays of the missions, and return their results."""
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
        inputs, agents, timing, arrays = call
        inputs = tabulate_stages(inputs, self._tabulate)
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
        if not isinstance(value, Generator):
            return self._numbers[value]
        key = id(value.bit_generator)
        if key not in self._states:
            self._states[key] = copy_state(value)
            self._pieces.add(self._states[key])
        return _address(self._states[key])


def copy_state(rng: Generator) -> Words:
    """Return the state of a PCG64 generator as the six words that kernels use."""
    state: Any = rng.bit_generator.state
    numbers = state["state"]["state"], state["state"]["inc"]
    words = [part for number in numbers for part in divmod(number, 1 << _WORD_BITS)[::-1]]
    words += [state["has_uint32"], state["uinteger"]]
    return np.array(words, dtype=np.uint64).view(np.int64)


def _address(array: NDArray[Any]) -> int:
    return int(array.__array_interface__["data"][0])


_STAGE_ADDRESSES = {kind: find_addresses(record) for kind, record in KERNEL_STAGES.items()}
_ROW_ADDRESSES = [
    start // WORD_SIZE + place
    for record, start in zip(RECORDS.values(), accumulate(_SIZES, initial=0), strict=False)
    for place in find_addresses(record)
]
"""Indices of the words in a row that are addresses of arrays."""
