"""Named tuples survive packing, interpreted and compiled, and wrong ones are named."""

from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from evoros.base.arrays import Array, Matrix
from evoros.base.errors import InputError
from evoros.base.packing import pack, unpack
from evoros.compilation.machine_code import compile_function, compiling
from evoros.compilation.rules import A1

NUMBERS = st.floats(width=64) | st.integers(-1000, 1000) | st.booleans()
VECTORS = arrays(np.float64, st.integers(0, 5))
MATRICES = arrays(np.float64, array_shapes(min_dims=2, max_dims=2, min_side=0, max_side=4))


class Values(NamedTuple):
    first: float
    vector: Array
    matrix: Matrix
    other: Array
    last: float


class Nothing(NamedTuple):
    pass


VALUES = st.builds(Values, NUMBERS, VECTORS, MATRICES, VECTORS, NUMBERS)


def same(one: Any, other: Any) -> bool:
    """All bits, and the shapes."""
    return all(
        np.shape(a) == np.shape(b) and np.float64(a).tobytes() == np.float64(b).tobytes()
        for a, b in zip(one, other, strict=True)
    )


@given(VALUES)
def test_unpacking_inverts_packing(values: Values) -> None:
    packed = pack(values)
    assert packed.dtype == np.float64
    assert packed.flags.c_contiguous
    unpacked = unpack(Values, packed)
    assert same(unpacked, values)
    assert type(unpacked.first) is float
    assert all(np.shares_memory(packed, a) for a in unpacked[1:4] if a.size)


def copy_back(packed: Array, out: Array) -> None:
    """Write all values of a packed tuple in turn, and change each array."""
    values = unpack(Values, packed)
    out[0] = values.first
    at = 1
    for i in range(len(values.vector)):
        out[at] = values.vector[i]
        values.vector[i] = 1.0
        at += 1
    rows, columns = values.matrix.shape
    for i in range(rows):
        for j in range(columns):
            out[at] = values.matrix[i, j]
            values.matrix[i, j] = 2.0
            at += 1
    for i in range(len(values.other)):
        out[at] = values.other[i]
        values.other[i] = 3.0
        at += 1
    out[at] = values.last


@cache
def compiled() -> Any:
    with compiling():
        return compile_function(copy_back, (A1, A1), on_disk=False)


@settings(deadline=None)  # the first call compiles
@given(VALUES)
def test_compiled_code_has_the_same_values_and_writes_to_the_packed_array(values: Values) -> None:
    packed = [pack(values), pack(values)]
    size = 2 + values.vector.size + values.matrix.size + values.other.size
    read = np.zeros((2, size))
    copy_back(packed[0], read[0])
    compiled()(packed[1], read[1])
    assert read[0].tobytes() == read[1].tobytes()
    assert packed[0].tobytes() == packed[1].tobytes()
    expected = np.concatenate([np.ravel(value) for value in values], dtype=np.float64)
    assert expected.tobytes() == read[0].tobytes()
    assert (unpack(Values, packed[0]).matrix == 2.0).all()


def test_a_tuple_may_be_empty() -> None:
    assert pack(Nothing()).size == 0
    assert unpack(Nothing, np.zeros(0)) == Nothing()


GOOD = Values(1.0, np.zeros(2), np.zeros((2, 3)), np.zeros(0), 2.0)


@pytest.mark.parametrize(
    ("field", "value", "rule"),
    [
        ("first", np.zeros(1), "a number, not"),
        ("first", None, "a number, not None"),
        ("vector", [0.0, 1.0], r"a one-dimensional array of float64, not \[0.0, 1.0\]"),
        ("vector", np.zeros((2, 2)), "a one-dimensional array of float64"),
        ("vector", np.zeros(2, dtype=np.int64), "a one-dimensional array of float64"),
        ("vector", 1.0, "a one-dimensional array of float64"),
        ("matrix", np.zeros(3), "a two-dimensional array of float64"),
    ],
)
def test_a_value_that_its_field_does_not_allow_is_named(field: str, value: Any, rule: str) -> None:
    with pytest.raises(
        InputError, match=rf"test_packing\.Values\.{field}: must be {rule}"
    ) as error:
        pack(GOOD._replace(**{field: value}))
    assert "\n" not in str(error.value)


class Odd(NamedTuple):
    size: int
    names: list[str]


def test_a_field_that_is_declared_otherwise_is_named() -> None:
    with pytest.raises(InputError, match=r"Odd\.size: must be declared as float, Array or Matrix"):
        pack(Odd(1, []))
