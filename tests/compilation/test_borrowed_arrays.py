"""Rules own no arrays, so that their code counts no references, unless they make some."""

import numpy as np

from evoros.base.arrays import Array
from evoros.base.compilable import compilable
from evoros.base.rng import Generator, generator
from evoros.compilation.rules import FILTER, compile_rule

NOTHING = np.zeros(0)


def borrow(
    parameters: Array, memory: Array, rng: Generator, source: Array, values: Array, time: float
) -> None:
    """Half of the values, through two views."""
    for part in (values[: len(values) // 2], values[len(values) // 2 :]):
        rest = part[:]
        for i in range(len(rest)):
            rest[i] *= 0.5


@compilable
def reversed_copy(values: Array) -> Array:
    copy = np.empty(len(values))
    for i in range(len(values)):
        copy[i] = values[-1 - i]
    return copy


def make(
    parameters: Array, memory: Array, rng: Generator, source: Array, values: Array, time: float
) -> None:
    """The values in reverse order, by an array that the rule makes."""
    copy = reversed_copy(values)
    for i in range(len(values)):
        values[i] = copy[i]


def test_code_that_borrows_arrays_counts_no_references() -> None:
    rule, values = compile_rule(borrow, FILTER), np.arange(4.0)
    (code,) = rule._dispatcher.inspect_llvm().values()
    own = code.partition("@_ZN7cpython")[0]  # what follows takes arguments from Python
    assert "call void @NRT" not in own
    assert rule.borrows
    rule(NOTHING, NOTHING, generator("k", "p"), NOTHING, values, 0.0)
    assert values.tolist() == [0.0, 0.5, 1.0, 1.5]


def test_a_rule_that_makes_an_array_is_compiled_all_the_same() -> None:
    rule, values = compile_rule(make, FILTER), np.arange(4.0)
    assert not rule.borrows
    rule(NOTHING, NOTHING, generator("k", "p"), NOTHING, values, 0.0)
    assert values.tolist() == [3.0, 2.0, 1.0, 0.0]
