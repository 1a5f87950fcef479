"""Stages of a mission as tables of addresses, so that one compiled loop serves any number of them.

Tuples of stages would have a type for each length, and compile in a time that grows faster than it.
"""

from collections.abc import Callable, Sequence
from ctypes import PYFUNCTYPE, c_char_p, c_void_p, py_object, pythonapi
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core.cgutils import create_struct_proxy
from numba.extending import lower_builtin, type_callable
from numpy.typing import NDArray

from evoros.compilation.draws import RNG
from evoros.compilation.numbered_rules import RULES, make_kernel_generator
from evoros.compilation.records import WORD, Reader, count_words, list_words
from evoros.compilation.rules import A1, FILTER, I8, LAYER
from evoros.mission.inputs import FilterStage, LayerStage, get_stage

TABLE = types.Array(I8, 2, "C")
"""A row for each stage, of its words. The word of a rule or a generator is its address."""
KERNEL_TABLE = types.Array(I8, 2, "C", readonly=True)
"""The same for a kernel: the word of a rule is its number, and that of a generator the address of
its state. numba tells the two apart because kernels only read theirs."""


def _name_types(rule: Any, layer: Any) -> dict[type[FilterStage | LayerStage], Any]:
    stage = (I8, rule, A1, A1, RNG, A1, A1, I8, I8)
    return {
        FilterStage: types.NamedTuple(stage, FilterStage),
        LayerStage: types.NamedTuple((layer, A1, A1), LayerStage),
    }


STAGES = _name_types(types.FunctionType(FILTER), types.FunctionType(LAYER))
KERNEL_STAGES = _name_types(RULES["filter"], RULES["layer"])
"""The types of stages in tables, and in those of kernels."""

_BITS = types.NumPyRandomBitGeneratorType("bit_generator")

# A function of its own, because the types of pythonapi's belong to the whole process.
_find_pointer = PYFUNCTYPE(c_void_p, py_object, c_char_p)(("PyCapsule_GetPointer", pythonapi))


def find_address(value: Any) -> int:
    """Return the address of a compiled rule, or of a generator."""
    if hasattr(value, "bit_generator"):
        return int(_find_pointer(value.bit_generator.capsule, b"BitGenerator"))
    return int(value.__wrapper_address__())


def tabulate(
    kind: type[FilterStage | LayerStage],
    stages: Sequence[FilterStage | LayerStage],
    name: Callable[[Any], int] = find_address,
) -> NDArray[np.int64]:
    """Return the table of stages of a kind, whose rules are compiled; it does not keep them.

    ``name`` returns the word of a rule or a generator.
    """
    types_ = STAGES[kind]
    rows = [list(list_words(types_, stage, name)) for stage in stages]
    return np.array(rows, dtype=np.int64).reshape(len(stages), count_words(types_))


@type_callable(get_stage)  # type: ignore[untyped-decorator]
def _type(context: Any) -> Any:
    def name_type(kind: Any, table: Any, place: Any) -> Any:
        stages = KERNEL_STAGES if table == KERNEL_TABLE else STAGES
        return stages[kind.instance_class]

    return name_type


@lower_builtin(get_stage, types.NamedTupleClass, types.Array, types.Integer)  # type: ignore[untyped-decorator]
def _get_stage(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    """Make the named tuple."""
    stage, table = signature.return_type, signature.args[1]
    start = builder.mul(arguments[2], ir.Constant(arguments[2].type, count_words(stage)))
    place = builder.gep(context.make_array(table)(context, builder, arguments[1]).data, [start])
    make_generator = make_kernel_generator if table == KERNEL_TABLE else _make_generator
    return Reader(context, builder, place, make_generator).read(stage)


def _make_generator(context: Any, builder: Any, address: Any) -> Any:
    """Make a generator of numpy's ``bitgen_t`` (numpy/random/bitgen.h) at an address."""
    functions = builder.inttoptr(address, WORD.as_pointer())
    rng = create_struct_proxy(RNG)(context, builder)
    bits = create_struct_proxy(_BITS)(context, builder)
    names = ("state", "fnptr_next_uint64", "fnptr_next_uint32", "fnptr_next_double")
    for place, name in enumerate(names):
        value = builder.load(builder.gep(functions, [WORD(place)]))
        setattr(bits, name, value)
    rng.bit_generator = bits._getvalue()
    return rng._getvalue()
