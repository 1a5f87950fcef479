"""Values reduced to their bits, so that equality is exact and any NaN equals any NaN."""

import math
from collections.abc import Mapping, Sequence, Set
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

LEAVES = (str, bytes, int, bool, type(None))


def bits(value: Any) -> Any:
    """Return nested tuples that are equal for values with equal bits, types and shapes.

    A dataclass counts by its fields, any other object by its attributes, and a random generator by
    its state.
    """
    return _bits(value, ())


def _bits(value: Any, above: tuple[int, ...]) -> Any:
    if id(value) in above:
        return "itself"
    above = (*above, id(value))
    if isinstance(value, LEAVES):
        return (type(value).__name__, value)
    if isinstance(value, float | np.floating):
        return "nan" if math.isnan(value) else float(value).hex()
    if isinstance(value, np.ndarray):
        return _array_bits(value)
    if isinstance(value, np.random.Generator):
        return repr(value.bit_generator.state)
    if is_dataclass(value) and not isinstance(value, type):
        content = [(field.name, getattr(value, field.name)) for field in fields(value)]
        return (_name(type(value)), *((name, _bits(item, above)) for name, item in content))
    return _container_bits(value, above)


def _array_bits(array: np.ndarray[Any, Any]) -> Any:
    if array.dtype.kind == "f":
        array = np.where(np.isnan(array), np.nan, array)
    return (array.dtype.str, array.shape, array.tobytes())


def _container_bits(value: Any, above: tuple[int, ...]) -> Any:
    if isinstance(value, Mapping):
        return tuple((_bits(key, above), _bits(item, above)) for key, item in value.items())
    if isinstance(value, Set):
        return tuple(sorted((_bits(item, above) for item in value), key=repr))
    if isinstance(value, Sequence):
        return tuple(_bits(item, above) for item in value)
    if isinstance(value, type) or callable(value):
        return _name(value)
    return (_name(type(value)), _bits(getattr(value, "__dict__", None), above))


def _name(definition: Any) -> str:
    return f"{definition.__module__}.{getattr(definition, '__qualname__', type(definition))}"
