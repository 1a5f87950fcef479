"""The mission loop as a function of an address, which a kernel calls for each of its missions."""

from functools import cache
from itertools import accumulate
from typing import Any, NamedTuple

from numba import types
from numba.extending import lower_builtin, type_callable

from evoros.base.arrays import Array
from evoros.compilation.machine_code import (
    BORROWING,
    Lowered,
    compile_function,
    compiling,
    lower,
    register,
)
from evoros.compilation.numbered_rules import RULES, make_kernel_generator
from evoros.compilation.records import WORD, Reader, count_words, find_addresses
from evoros.compilation.rules import A1, A2, F8, I8
from evoros.mission.inputs import Agents, Arrays, LoopInputs, LoopResult, Timing
from evoros.mission.loop import run_loop
from evoros.mission.stage_tables import KERNEL_TABLE

WORD_SIZE = 8  # bytes


class Ending(NamedTuple):
    """Where a mission writes its ``LoopResult``, as numbers."""

    result: Array  # (3,)


_TRUTHS, _INTEGERS = types.Array(types.boolean, 1, "C"), types.Array(I8, 1, "C")
_MOTION = RULES["observe"], RULES["sense"], RULES["advance"]

RECORDS = {
    LoopInputs: types.NamedTuple((*_MOTION, A1, A1, *(KERNEL_TABLE,) * 4, I8), LoopInputs),
    Agents: types.NamedTuple((A1, _TRUTHS, _TRUTHS, *(_INTEGERS,) * 6), Agents),
    Timing: types.NamedTuple((F8, *(I8,) * 5), Timing),
    Arrays: types.NamedTuple((A2, *(A1,) * 8, A2, A1, A2, A2), Arrays),
    Ending: types.NamedTuple((A1,), Ending),
}
"""The records of a row, which is a mission, one after another."""

_SIZES = [WORD_SIZE * count_words(record) for record in RECORDS.values()]
ROW_SIZE = sum(_SIZES)
"""Bytes of a row."""
_, AGENTS, TIMING, ARRAYS, ENDING, _ = accumulate(_SIZES, initial=0)
"""Where the records after the first begin in a row [bytes]."""


def list_row_addresses() -> list[int]:
    """Return which words of a row are addresses of arrays."""
    starts = [size // WORD_SIZE for size in accumulate(_SIZES, initial=0)]
    pairs = zip(RECORDS.values(), starts, strict=False)
    return [start + place for record, start in pairs for place in find_addresses(record)]


def read_record(kind: Any, address: int) -> Any:
    """Return a record at an address; only compiled code can."""
    raise NotImplementedError


@type_callable(read_record)  # type: ignore[untyped-decorator]
def _type(context: Any) -> Any:
    return lambda kind, address: RECORDS[kind.instance_class]


@lower_builtin(read_record, types.NamedTupleClass, types.Integer)  # type: ignore[untyped-decorator]
def _read_record(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    place = builder.inttoptr(arguments[1], WORD.as_pointer())
    return Reader(context, builder, place, make_kernel_generator).read(signature.return_type)


def run_row(row: int) -> None:
    """Run the mission whose row lies at an address."""
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
def lower_loop() -> Lowered:
    """Make the code of ``run_row`` for kernels."""
    signature = types.void(I8)
    register(run_loop, run_loop, False)
    with compiling() as on_disk:
        return lower(compile_function(run_row, signature, on_disk, **BORROWING), signature)
