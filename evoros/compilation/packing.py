"""Tells numba of ``evoros.base.packing.unpack``."""

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import lower_builtin, type_callable
from numba.np.arrayobj import populate_array

from evoros.base.packing import list_dimensions, unpack

_INTEGER = ir.IntType(64)


@type_callable(unpack)  # type: ignore[untyped-decorator]
def _type(context: Any) -> Any:
    def name_type(kind: Any, packed: Any) -> Any:
        counts = list_dimensions(kind.instance_class)
        fields = [types.Array(types.float64, n, "C") if n else types.float64 for n in counts]
        return types.NamedTuple(fields, kind.instance_class)

    return name_type


@lower_builtin(unpack, types.NamedTupleClass, types.Array)  # type: ignore[untyped-decorator]
def _unpack(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    """Make the named tuple. Its arrays own no memory, so that nothing counts references to them."""
    result, packed = signature.return_type, signature.args[1]
    place = context.make_array(packed)(context, builder, arguments[1]).data
    values = []
    for field in result.types:
        count = field.ndim if isinstance(field, types.Array) else 0
        head = [builder.load(builder.gep(place, [_INTEGER(i)])) for i in range(max(count, 1))]
        place = builder.gep(place, [_INTEGER(len(head))])
        if count == 0:
            values += head
            continue
        shape = [builder.fptosi(length, _INTEGER) for length in head]
        array = borrow_array(context, builder, field, place, shape)
        place = builder.gep(place, [array.nitems])
        values.append(array._getvalue())
    return context.make_tuple(builder, result, values)


def borrow_array(context: Any, builder: Any, kind: Any, place: Any, shape: Any) -> Any:
    """Make an array of one or two dimensions over values that something else keeps alive."""
    item = _INTEGER(context.get_abi_sizeof(context.get_data_type(kind.dtype)))
    strides = [builder.mul(shape[1], item), item] if len(shape) == 2 else [item]
    array = context.make_array(kind)(context, builder)
    populate_array(array, place, shape, strides, item, meminfo=None)
    return array
