"""Rules get the elementary functions of evoros, however they name those of Python and numpy."""

import math
from functools import partial
from math import cos
from typing import Any

import numpy as np

from evoros.base import elementary
from evoros.base.arrays import NO_VALUES, Array
from evoros.base.compilable import compilable
from evoros.base.rng import generator
from evoros.compilation.named_rules import NamedRule
from evoros.compilation.rules import FILTER, NotCompilable, compile_rule, substitute, try_compile
from evoros.filter.protocol import FILTER_ARGUMENTS

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
