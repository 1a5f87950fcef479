"""Packs named tuples of numbers and arrays into one array, so that rules share a signature."""

import math
from functools import cache
from typing import Any, NamedTuple, TypeVar, get_type_hints

import numpy as np

from evoros.base.arrays import Array, Matrix
from evoros.base.checks import quote
from evoros.base.errors import InputError

P = TypeVar("P", bound=NamedTuple)

_DIMENSIONS: dict[Any, int] = {float: 0, Array: 1, Matrix: 2}
_FLOAT = np.dtype(float)
_KINDS = "a number", "a one-dimensional array", "a two-dimensional array"


@cache
def list_dimensions(kind: type[NamedTuple]) -> tuple[int, ...]:
    """Return the number of dimensions of each field: 0 for numbers, 1 or 2 for arrays."""
    hints = get_type_hints(kind, include_extras=True)
    for name in kind._fields:
        if hints[name] not in _DIMENSIONS:
            raise InputError(
                f"{name_field(kind, name)}: must be declared as float, Array or Matrix, not "
                f"{hints[name]!r}; correct the declaration"
            )
    return tuple(_DIMENSIONS[hints[name]] for name in kind._fields)


def name_field(kind: type[NamedTuple], field: str) -> str:
    """Return the full name of a field for a message."""
    return f"{kind.__module__}.{kind.__qualname__}.{field}"


def pack(values: NamedTuple) -> Array:
    """Pack numbers and arrays into a flat array; the shape of each array precedes it."""
    kind = type(values)
    parts: list[Any] = []
    for name, count, value in zip(kind._fields, list_dimensions(kind), values, strict=True):
        if not _fits(value, count):
            raise InputError(
                f"{name_field(kind, name)}: must be "
                f"{_KINDS[count]}{' of float64' if count else ''}, not {quote(value)}; correct "
                "the value that the part's start() sets"
            )
        parts += [value.shape, value.ravel()] if count else [(value,)]
    return np.concatenate(parts or [()], dtype=np.float64)


def _fits(value: object, dimensions: int) -> bool:
    if dimensions == 0:
        return isinstance(value, float | int | np.floating | np.integer | np.bool_)
    return isinstance(value, np.ndarray) and value.dtype == _FLOAT and value.ndim == dimensions


def unpack(kind: type[P], packed: Array) -> P:
    """Return the named tuple that was packed; its arrays are views of ``packed``."""
    values: list[Any] = []
    at = 0
    for count in list_dimensions(kind):
        if count == 0:
            values.append(float(packed[at]))
            at += 1
        else:
            shape = [int(length) for length in packed[at : at + count]]
            end = at + count + math.prod(shape)
            values.append(packed[at + count : end].reshape(shape))
            at = end
    return kind(*values)
