"""Failures that are stated, and those that go through all sets of sensors."""

import math
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
from evoros.failure.protocol import Fault, SystematicFailure
from evoros.failure.random import RandomFailure
from evoros.filter.protocol import Channels

Case = tuple[tuple[int, ...], float]


def channels(count: int) -> Channels:
    place = np.column_stack((np.arange(count) / 50, np.zeros((count, 2))))
    return Channels(np.full(count, 0.06), np.full(count, 4.5), place, 0.1)


def case_of(faults: tuple[Fault, ...]) -> Case:
    """The sensors that fail, and when; infinity if none does."""
    if not faults:
        return (), math.inf
    (fault,) = faults
    failed = np.flatnonzero(np.isfinite(fault.onset))
    (time,) = set(fault.onset[failed].tolist())
    return tuple(failed.tolist()), time


@given(st.integers(0, 9), st.data())
def test_ranks_are_the_order_of_combinations(count: int, data: st.DataObject) -> None:
    size = data.draw(st.integers(0, count))
    every = list(combinations(range(count), size))
    assert [choose_set(count, size, rank) for rank in range(len(every))] == every


@given(st.integers(0, 6), st.integers(0, 7), st.integers(0, 7), st.integers(1, 3))
def test_trials_meet_each_case_once_and_then_again(
    count: int, least: int, more: int, times: int
) -> None:
    most = least + more
    failure = ExhaustiveFailure(least, most, tuple(10.0 * i for i in range(times)))
    assert isinstance(failure, SystematicFailure)
    total = failure.count_cases(count)
    cases = [case_of(failure.draw_case(channels(count), trial)) for trial in range(2 * total)]
    assert cases[:total] == cases[total:]
    assert len(set(cases)) == total
    sizes = [len(failed) for failed, _ in cases[:total]]
    assert sizes == sorted(sizes)
    low, high = min(least, count), min(most, count)
    wanted = {
        (failed, 10.0 * i if failed else math.inf)
        for size in range(low, high + 1)
        for failed in combinations(range(count), size)
        for i in range(times)
    }
    assert set(cases) == wanted


def test_six_sensors_have_64_sets() -> None:
    assert ExhaustiveFailure(times_s=(0.0,)).count_cases(6) == 64
    assert ExhaustiveFailure().count_cases(6) == 1 + 63 * 3  # as conf/failure/exhaustive.yaml says


def test_a_case_is_repeated_by_stating_it() -> None:
    failure = ExhaustiveFailure()
    for trial in range(1, failure.count_cases(5)):
        failed, time = case_of(failure.draw_case(channels(5), trial))
        stated = GivenFailure(failed, time).draw(channels(5), generator("any", "failure"))
        assert case_of(stated) == (failed, time)


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
