"""Draws are those of numpy, compiled and interpreted, and need no function of the C library."""

import pickle
import re
from collections import Counter
from itertools import islice, permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evoros.base.arrays import Array
from evoros.base.rng import Generator, deal, generator
from evoros.compilation.machine_code import compile_function, compiling
from evoros.compilation.rules import FILTER

COUNT = 100_000  # some 30 of the normal deviates are in the tails
NOTHING = np.zeros(0)


def draw_normal(
    parameters: Array, memory: Array, rng: Generator, source: Array, values: Array, time: float
) -> None:
    for i in range(len(values)):
        values[i] = rng.standard_normal()


def draw_others(
    parameters: Array, memory: Array, rng: Generator, source: Array, values: Array, time: float
) -> None:
    for i in range(0, len(values), 5):
        values[i] = rng.normal(1.0, 2.0)
        values[i + 1] = rng.exponential(3.0)
        values[i + 2] = rng.lognormal(0.1, 0.2)
        values[i + 3] = rng.uniform(-1.0, 2.0)
        values[i + 4] = rng.standard_exponential()


def of_numpy(key: str) -> np.random.Generator:
    return np.random.Generator(generator(key, "part").bit_generator)


@pytest.mark.slow
@pytest.mark.parametrize("rule", [draw_normal, draw_others])
def test_compiled_draws_are_the_interpreted_ones(rule: object) -> None:
    with compiling():
        compiled = compile_function(rule, FILTER, False)
    ours, theirs = generator("a", "part"), generator("a", "part")
    fast, slow = np.empty(COUNT), np.empty(COUNT)
    compiled(NOTHING, NOTHING, ours, NOTHING, fast, 0.0)
    compiled.py_func(NOTHING, NOTHING, theirs, NOTHING, slow, 0.0)
    assert (fast == slow).all()
    assert ours.bit_generator.state == theirs.bit_generator.state
    (code,) = compiled.inspect_llvm().values()
    called = {word.strip('"') for word in re.findall(r"call [^@\n]*@(\S+?)\(", code)}
    assert not called & {"log1p", "exp", "log", "llvm.exp.f64", "llvm.log.f64"}


def test_normal_and_exponential_draws_are_those_of_numpy() -> None:
    ours, theirs = generator("a", "part"), of_numpy("a")
    for mine, numpys in (
        (ours.standard_normal(COUNT), theirs.standard_normal(COUNT)),
        (ours.standard_exponential(COUNT), theirs.standard_exponential(COUNT)),
        (ours.normal(2.0, 3.0, (40, 5)), theirs.normal(2.0, 3.0, (40, 5))),
        (ours.exponential(2.0, 70), theirs.exponential(2.0, 70)),
        (ours.lognormal(0.5, 0.25, 70), theirs.lognormal(0.5, 0.25, 70)),
        (ours.normal([1.0, 2.0], [[3.0], [4.0]]), theirs.normal([1.0, 2.0], [[3.0], [4.0]])),
    ):
        np.testing.assert_allclose(mine, numpys, rtol=4e-16)
    assert ours.bit_generator.state == theirs.bit_generator.state
    assert isinstance(ours.normal(), float)
    assert isinstance(ours.lognormal(), float)


def test_other_draws_are_those_of_numpy() -> None:
    ours, theirs = generator("b", "part"), of_numpy("b")
    for method, arguments in (
        ("random", (9,)),
        ("uniform", (-1.0, 3.0, 9)),
        ("integers", (1000,)),
        ("permutation", (9,)),
    ):
        assert (getattr(ours, method)(*arguments) == getattr(theirs, method)(*arguments)).all()


def test_a_copy_continues_the_stream() -> None:
    ours = generator("c", "part")
    ours.random()
    copy = pickle.loads(pickle.dumps(ours))
    assert type(copy) is Generator
    assert copy.standard_normal() == ours.standard_normal()


@given(st.integers(1, 40), st.text(max_size=5))
def test_each_deck_has_each_number_once(cards: int, key: str) -> None:
    numbers = list(islice(deal(key, cards), 3 * cards))
    decks = [numbers[i : i + cards] for i in range(0, len(numbers), cards)]
    assert all(sorted(deck) == list(range(cards)) for deck in decks)
    assert list(islice(deal(key, cards), 2 * cards)) == numbers[: 2 * cards]


def test_all_orders_of_a_deck_are_equally_likely() -> None:
    """So the first numbers are a simple random sample, whatever was dealt in decks before."""
    orders = list(permutations(range(4)))
    for deck in (0, 1):
        dealt = (islice(deal(f"{key}", 4), 4 * deck, 4 * deck + 4) for key in range(2400))
        counts = Counter(map(tuple, dealt))
        deviation = sum((counts[order] - 100) ** 2 / 100 for order in orders)
        assert deviation < 55  # chi-square with 23 degrees of freedom exceeds this in 1 of 5000


def test_a_long_deck_costs_what_is_dealt() -> None:
    assert len(set(islice(deal("key", 10**15), 1000))) == 1000
