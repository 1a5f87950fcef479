"""Stages of a mission as tables of addresses, so that one compiled loop serves any number of them.

Tuples of stages would have a type for each length, and compile in a time that grows faster than it.
"""

from collections.abc import Iterator, Sequence
from ctypes import PYFUNCTYPE, c_char_p, c_void_p, py_object, pythonapi
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core.cgutils import create_struct_proxy
from numba.extending import lower_builtin, type_callable
from numpy.typing import NDArray

from evoros.compilation.draws import RNG
from evoros.compilation.packing import borrow_array
from evoros.compilation.rules import A1, FILTER, I8, LAYER
from evoros.mission.inputs import FilterStage, LayerStage, get_stage

TABLE = types.Array(I8, 2, "C")
"""A row for each stage. A number has one column; a rule and a generator one, their address; an
array two, its address and its length."""

_FIELDS = {
    FilterStage: (I8, types.FunctionType(FILTER), A1, A1, RNG, A1, A1, I8, I8),
    LayerStage: (types.FunctionType(LAYER), A1, A1),
}
_WIDTHS = {kind: sum(2 if field is A1 else 1 for field in _FIELDS[kind]) for kind in _FIELDS}

_BITS = types.NumPyRandomBitGeneratorType("bit_generator")

# A function of its own, because the types of pythonapi's belong to the whole process.
_find_pointer = PYFUNCTYPE(c_void_p, py_object, c_char_p)(("PyCapsule_GetPointer", pythonapi))


def tabulate(
    kind: type[FilterStage | LayerStage], stages: Sequence[FilterStage | LayerStage]
) -> NDArray[np.int64]:
    """Return the table of stages of a kind, whose rules are compiled; it does not keep them."""
    rows = [list(_list_columns(_FIELDS[kind], stage)) for stage in stages]
    return np.array(rows, dtype=np.int64).reshape(len(stages), _WIDTHS[kind])


def _list_columns(fields: Sequence[Any], stage: Sequence[Any]) -> Iterator[int]:
    for field, value in zip(fields, stage, strict=True):
        if field is A1:
            yield value.__array_interface__["data"][0]
            yield len(value)
        elif field is I8:
            yield value
        elif field is RNG:
            yield _find_pointer(value.bit_generator.capsule, b"BitGenerator")
        else:
            yield value.__wrapper_address__()


@type_callable(get_stage)  # type: ignore[untyped-decorator]
def _type(context: Any) -> Any:
    return lambda kind, table, place: types.NamedTuple(
        _FIELDS[kind.instance_class], kind.instance_class
    )


@lower_builtin(get_stage, types.NamedTupleClass, types.Array, types.Integer)  # type: ignore[untyped-decorator]
def _get_stage(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    """Make the named tuple. Nothing in it owns memory, so that nothing counts references to it."""
    stage, table = signature.return_type, signature.args[1]
    start = builder.mul(arguments[2], ir.Constant(arguments[2].type, _WIDTHS[stage.instance_class]))
    data = context.make_array(table)(context, builder, arguments[1]).data
    at = 0

    def read() -> Any:
        nonlocal at
        place = builder.add(start, ir.Constant(start.type, at))
        at += 1
        return builder.load(builder.gep(data, [place]))

    values = []
    for field in stage.types:
        if field is A1:
            place = builder.inttoptr(read(), ir.DoubleType().as_pointer())
            values.append(borrow_array(context, builder, A1, place, [read()])._getvalue())
        elif field is RNG:
            values.append(_make_generator(context, builder, read()))
        elif isinstance(field, types.FunctionType):
            rule = create_struct_proxy(field)(context, builder)
            rule.c_addr = builder.inttoptr(read(), rule.c_addr.type)
            values.append(rule._getvalue())
        else:
            values.append(read())
    return context.make_tuple(builder, stage, values)


def _make_generator(context: Any, builder: Any, address: Any) -> Any:
    """Make a generator of numpy's ``bitgen_t`` (numpy/random/bitgen.h) at an address."""
    number = ir.IntType(64)
    functions = builder.inttoptr(address, number.as_pointer())
    rng = create_struct_proxy(RNG)(context, builder)
    bits = create_struct_proxy(_BITS)(context, builder)
    names = ("state", "fnptr_next_uint64", "fnptr_next_uint32", "fnptr_next_double")
    for place, name in enumerate(names):
        value = builder.load(builder.gep(functions, [ir.Constant(number, place)]))
        setattr(bits, name, value)
    rng.bit_generator = bits._getvalue()
    return rng._getvalue()
