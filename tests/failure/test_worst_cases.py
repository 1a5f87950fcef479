"""Failures that are stated, and those that go through all sets of sensors."""

from collections import Counter
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evoros.base.errors import InputError
from evoros.base.rng import generator
from evoros.failure.combined import CombinedFailure
from evoros.failure.exhaustive import ExhaustiveFailure, choose_set
from evoros.failure.given import GivenFailure
from evoros.failure.protocol import Case, SystematicFailure, make_faults
from evoros.failure.random import RandomFailure
from evoros.filter.protocol import Channels
from evoros.testing.part import bits


def channels(count: int) -> Channels:
    place = np.column_stack((np.arange(count) / 50, np.zeros((count, 2))))
    return Channels(np.full(count, 0.06), np.full(count, 4.5), place, 0.1)


@given(st.integers(0, 9), st.data())
def test_ranks_are_the_order_of_combinations(count: int, data: st.DataObject) -> None:
    size = data.draw(st.integers(0, count))
    every = list(combinations(range(count), size))
    assert [choose_set(count, size, rank) for rank in range(len(every))] == every


@given(st.integers(0, 6), st.integers(0, 7), st.integers(0, 7), st.integers(1, 3))
def test_the_cases_are_all_sets_at_all_times(count: int, least: int, more: int, times: int) -> None:
    failure = ExhaustiveFailure(least, least + more, tuple(10.0 * i for i in range(times)))
    assert isinstance(failure, SystematicFailure)
    total = failure.count_cases(count)
    cases = [failure.state_case(count, number) for number in range(total)]
    low, high = min(least, count), min(least + more, count)
    wanted = {
        Case(failed, (10.0 * i,) * size)
        for size in range(low, high + 1)
        for failed in combinations(range(count), size)
        for i in range(times)
    }
    assert set(cases) == wanted
    assert len(wanted) == total
    with pytest.raises(ValueError, match=f"number must be below {total}"):
        failure.state_case(count, total)


def test_six_sensors_have_64_sets() -> None:
    assert ExhaustiveFailure(times_s=(0.0,)).count_cases(6) == 64
    assert ExhaustiveFailure().count_cases(6) == 1 + 63 * 3  # as conf/failure/exhaustive.yaml says


def test_a_case_is_repeated_by_stating_it() -> None:
    failure = ExhaustiveFailure()
    for number in range(failure.count_cases(5)):
        case = failure.state_case(5, number)
        stated = GivenFailure(case.sensors, case.times_s or 0.0)
        assert Case.parse(case.text) == case == stated.case


def test_a_draw_chooses_a_case_uniformly() -> None:
    failure, count = ExhaustiveFailure(most=2, times_s=(0.0, 5.0)), 3
    total = failure.count_cases(count)
    cases = [make_faults(failure, failure.state_case(count, i), count) for i in range(total)]
    draws = (
        failure.draw(channels(count), generator(f"{i}", "failure")) for i in range(200 * total)
    )
    counts = Counter(map(bits, draws))
    assert counts.keys() <= set(map(bits, cases))
    deviation = sum((counts[bits(case)] - 200) ** 2 / 200 for case in cases)
    assert total == 13
    assert deviation < 40  # chi-square with 12 degrees of freedom exceeds this in 1 of 10000


def test_sensors_that_the_robot_does_not_have_are_refused() -> None:
    with pytest.raises(InputError, match=r"failure.sensors: .* 0 to 1, not 2"):
        GivenFailure((0, 2)).draw(channels(2), generator("any", "failure"))


@pytest.mark.parametrize("bad", [[-1], [1, 1], [0.5], [True], "01"])
def test_stated_sensors_are_different_whole_numbers(bad: object) -> None:
    with pytest.raises(InputError, match="sensors"):
        GivenFailure(bad)  # type: ignore[arg-type]


def test_the_least_number_is_at_most_the_most() -> None:
    with pytest.raises(InputError, match="least"):
        ExhaustiveFailure(3, 2)


def test_a_systematic_failure_is_no_part_of_a_combined_one() -> None:
    with pytest.raises(InputError, match=r"failure.failures.all: .* ExhaustiveFailure"):
        CombinedFailure({"one": RandomFailure(), "all": ExhaustiveFailure()})
