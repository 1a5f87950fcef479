"""Functions of kernels and rules compute what Python's, numpy's and evoros's do, without arrays."""

import math
from collections.abc import Callable
from ctypes import CFUNCTYPE, POINTER, c_double, c_int32, c_int64, c_uint32, c_uint64
from functools import cache, partial
from math import cos
from typing import Any

import llvmlite.binding as llvm
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evoros.base import elementary
from evoros.base.arrays import NO_VALUES, Array
from evoros.base.compilable import compilable
from evoros.base.rng import Generator, generator
from evoros.compilation.kernel import target_host
from evoros.compilation.kernel_runtime import RUNTIME
from evoros.compilation.named_rules import NamedRule
from evoros.compilation.rules import FILTER, NotCompilable, compile_rule, substitute, try_compile
from evoros.filter.protocol import FILTER_ARGUMENTS
from evoros.mission.memory_image import copy_state

DRAWS = {"next_uint64": c_uint64, "next_uint32": c_uint32, "next_double": c_double}
_engines: list[Any] = []


@cache
def function_of(name: str, result: Any, *arguments: Any) -> Callable[..., Any]:
    """A function of the runtime, compiled for this processor."""
    machine = target_host().make_machine()
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(RUNTIME), machine)
    engine.finalize_object()
    _engines.append(engine)
    function: Callable[..., Any] = CFUNCTYPE(result, *arguments)(engine.get_function_address(name))
    return function


@given(st.text(), st.lists(st.sampled_from(sorted(DRAWS)), max_size=60))
def test_draws_are_those_of_numpy(key: str, draws: list[str]) -> None:
    """In any order: halves of words are kept for the next draw of 32 bits."""
    rng = generator(key, "part")
    bits = rng.bit_generator.ctypes
    state = copy_state(rng)
    for name in draws:
        draw = function_of(f"evoros.{name}", DRAWS[name], c_int64)
        assert draw(state.ctypes.data) == getattr(bits, name)(bits.state)
    assert copy_state(rng).tolist() == state.tolist()


@given(st.floats())
def test_a_number_is_its_fraction_and_its_exponent(x: float) -> None:
    split = function_of("numba_frexp", c_double, c_double, POINTER(c_int32))
    exponent = c_int32(7)
    fraction = split(x, exponent)
    if math.isnan(x):
        assert math.isnan(fraction)
        assert exponent.value == 0
        return
    assert (fraction, exponent.value) == math.frexp(x)
    assert np.signbit(fraction) == np.signbit(x)


numbers = st.floats(allow_nan=False)
near_ones = st.builds(lambda x, k: x * 2.0**k, st.floats(-2.0, 2.0), st.integers(-60, 60))


@given(numbers | near_ones, numbers | near_ones)
def test_remainders_are_exact(x: float, y: float) -> None:
    divide = function_of("evoros.remainder", c_double, c_double, c_double)
    if y == 0.0 or math.isinf(x):
        assert math.isnan(divide(x, y))
        return
    assert divide(x, y) == math.fmod(x, y)
    assert np.signbit(divide(x, y)) == np.signbit(math.fmod(x, y))


@given(st.floats(min_value=0.0))
def test_roots_are_rounded_correctly(x: float) -> None:
    assert function_of("sqrt", c_double, c_double)(x) == math.sqrt(x)


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


COUNT = 2000


@compilable
def swing(x: float) -> float:
    return math.exp(-abs(x)) * float(np.tanh(x))


def rule(values: Array, time: float) -> None:
    for i in range(len(values)):
        x = values[i]
        values[i] = math.sin(x) + cos(x) + np.arctan2(x, 2.0) + swing(x) + math.hypot(x, time)
        values[i] += math.log(1.5 + abs(x)) + math.pow(abs(x), 0.3) + math.sqrt(abs(x))


def rule_of_arrays(values: Array, time: float) -> None:
    values[:] = np.sin(values)


def deaf_rule(values: Array, time: float) -> None:
    """Only interpreted, because it raises."""
    if len(values) == 0:
        raise ValueError
    rule_of_arrays(values, time)
    values[0] = swing(values[0]) + math.log(8.0, 2.0)


def expected(x: float, time: float) -> float:
    sine, cosine = elementary.sin_cos(x)
    swung = elementary.exp(-abs(x)) * elementary.tanh(x)
    value = sine + cosine + elementary.atan2(x, 2.0) + swung + elementary.hypot(x, time)
    return value + (
        elementary.log(1.5 + abs(x)) + elementary.power(abs(x), 0.3) + math.sqrt(abs(x))
    )


def apply(rule: Any, x: Array) -> Array:
    values = x.copy()
    rule(values, 3.0)
    return values


def compiled(rule: Any) -> Any:
    code = compile_rule(NamedRule(rule, FILTER_ARGUMENTS), FILTER)
    return partial(code, NO_VALUES, NO_VALUES, generator("", ""), NO_VALUES)


X = np.random.default_rng(1).uniform(-9.0, 9.0, COUNT)


def test_compiled_and_interpreted_rules_have_the_functions_of_evoros() -> None:
    wanted = [expected(x, 3.0) for x in X.tolist()]
    assert apply(compiled(rule), X).tolist() == wanted
    assert apply(substitute(rule, helpers=True), X).tolist() == wanted
    assert apply(rule, X).tolist() != wanted  # or this test could not fail


@pytest.mark.slow
def test_numpy_functions_of_arrays_are_those_of_their_numbers() -> None:
    wanted = [elementary.sin(x) for x in X.tolist()]
    assert apply(compiled(rule_of_arrays), X).tolist() == wanted
    assert apply(substitute(rule_of_arrays), X).tolist() == wanted


def test_a_rule_that_is_only_interpreted_has_them_too() -> None:
    assert isinstance(try_compile(NamedRule(deaf_rule, FILTER_ARGUMENTS), FILTER), NotCompilable)
    values = apply(substitute(deaf_rule, helpers=True), X)
    sine = elementary.sin(float(X[0]))
    assert values[0] == elementary.exp(-abs(sine)) * elementary.tanh(sine) + 3.0
    assert values[1:].tolist() == [elementary.sin(x) for x in X[1:].tolist()]


def test_what_is_no_plain_function_of_a_user_stays_as_it_is() -> None:
    parts: tuple[Any, ...] = (print, elementary.sin, COUNT, math.sin)
    for part in parts:
        assert substitute(part) is part
