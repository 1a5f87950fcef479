"""Named tuples of numbers, arrays, rules and generators as words for compiled code."""

from collections.abc import Callable, Iterable, Iterator
from functools import cache
from itertools import accumulate
from struct import Struct
from typing import Any

from llvmlite import ir
from numba import types
from numba.core.cgutils import create_struct_proxy

from evoros.compilation.draws import RNG
from evoros.compilation.rules import F8, borrow_array

WORD = ir.IntType(64)
_DOUBLE = ir.DoubleType()
_AS_DOUBLE, _AS_WORD = Struct("d"), Struct("q")

_ARRAY, _NUMBER, _WHOLE, _NAMED = range(4)


@cache
def _list_fields(kind: Any) -> tuple[tuple[int, int], ...]:
    sorts = []
    for field in kind.types:
        if isinstance(field, types.Array):
            sorts.append((_ARRAY, 1 + field.ndim))
        elif field == F8:
            sorts.append((_NUMBER, 1))
        else:
            sorts.append((_WHOLE if isinstance(field, types.Integer) else _NAMED, 1))
    return tuple(sorts)


def count_words(kind: Any) -> int:
    """Return the number of words of a named tuple: address and shape of arrays, otherwise one."""
    return sum(count for _, count in _list_fields(kind))


def list_words(kind: Any, values: Iterable[Any], name: Callable[[Any], int]) -> Iterator[int]:
    """Yield the words of a named tuple; ``name`` returns the word of a rule or generator."""
    for (sort, _), value in zip(_list_fields(kind), values, strict=True):
        if sort == _ARRAY:
            yield value.__array_interface__["data"][0]
            yield from value.shape
        elif sort == _WHOLE:
            yield int(value)
        elif sort == _NUMBER:
            yield _AS_WORD.unpack(_AS_DOUBLE.pack(value))[0]
        else:
            yield name(value)


def find_addresses(kind: Any) -> list[int]:
    """Return the indices of words that are addresses of arrays or generators."""
    starts = accumulate((count for _, count in _list_fields(kind)), initial=0)
    return [
        start
        for field, start in zip(kind.types, starts, strict=False)
        if isinstance(field, types.Array) or field == RNG
    ]


class Reader:
    """Generates code that reads consecutive values from memory."""

    def __init__(
        self, context: Any, builder: Any, place: Any, make_generator: Callable[..., Any]
    ) -> None:
        self._context, self._builder, self._place = context, builder, place
        self._make_generator = make_generator

    def read(self, kind: Any) -> Any:
        """Generate code that reads the next value."""
        context, builder = self._context, self._builder
        if isinstance(kind, types.NamedTuple):
            return context.make_tuple(builder, kind, [self.read(field) for field in kind.types])
        if isinstance(kind, types.Array):
            return self._read_array(kind)
        if isinstance(kind, types.FunctionType):
            rule = create_struct_proxy(kind)(context, builder)
            rule.c_addr = builder.inttoptr(self._word(), rule.c_addr.type)
            return rule._getvalue()
        if kind == RNG:
            return self._make_generator(context, builder, self._word())
        return self._word(_DOUBLE if kind == F8 else WORD)

    def _word(self, kind: Any = WORD) -> Any:
        place = self._builder.bitcast(self._place, kind.as_pointer())
        self._place = self._builder.gep(self._place, [WORD(1)])
        return self._builder.load(place)

    def _read_array(self, kind: Any) -> Any:
        context, builder = self._context, self._builder
        data = builder.inttoptr(self._word(), context.get_data_type(kind.dtype).as_pointer())
        shape = [self._word() for _ in range(kind.ndim)]
        return borrow_array(context, builder, kind, data, shape)._getvalue()
