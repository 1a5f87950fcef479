"""The search for the smallest set of sensors that stops a design, for known designs."""

import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evoros.base.errors import InputError
from evoros.base.rng import generator
from evoros.failure.protocol import Case
from evoros.mission.mission import COMPLETED, TIME_LIMIT, Outcome
from evoros.worst_cases.worst_cases import CaseSearch, CaseTrials, WorstCases

Rate = Callable[[Case], float]
FAILURES = st.dictionaries(st.integers(0, 30), st.floats(0.0, 1e4), max_size=8)


def search_of(rate: Rate, sensors: int, config: WorstCases, seed: int = 0) -> CaseSearch:
    """A search on a design that completes its world at a rate that its failures set."""
    luck = random.Random(seed)

    def draw(case: Case) -> Outcome:
        done = luck.random() < rate(case)
        outcome = Outcome.failure(COMPLETED if done else TIME_LIMIT, "", 1.0, sensors)
        return replace(outcome, completed=done, progress=rate(case))

    def try_cases(cases: Sequence[CaseTrials], repeats: range) -> list[Mapping[str, list[Outcome]]]:
        return [{"world": [draw(trials.case) for _ in repeats]} for trials in cases]

    return CaseSearch(config, sensors, 1, try_cases, generator(f"{seed}", "search"))


def needs(*fatal: int) -> Rate:
    return lambda case: 0.0 if set(fatal) <= set(case.sensors) else 1.0 - 0.05 * len(case.sensors)


@given(FAILURES)
def test_a_case_reads_back_from_its_text(failures: dict[int, float]) -> None:
    case = Case.of(failures.items())
    assert Case.parse(case.text) == case
    assert case.sensors == tuple(sorted(failures))
    assert {i: t for i, t in enumerate(case.onsets(31)) if t < float("inf")} == failures


@settings(max_examples=15, deadline=None)
@given(st.sets(st.integers(0, 5), min_size=1, max_size=3))
def test_the_smallest_set_is_found_where_all_are_tried(fatal: set[int]) -> None:
    config = WorstCases(times_s=(0.0,), rounds=0, trials=30)
    search = search_of(needs(*fatal), 6, config)
    stopping = search.run()
    assert [set(trials.case.sensors) for trials in stopping] == [fatal]
    assert search.whole == set(range(1, len(fatal) + 1))
    assert all(len(case.sensors) <= len(fatal) for case in search.tried)


@pytest.mark.parametrize("fatal", [(3, 17), (0, 8, 23)])
def test_of_many_sensors_sets_grow_from_bad_ones_and_lose_what_they_do_not_need(
    fatal: tuple[int, ...],
) -> None:
    def rate(case: Case) -> float:  # each of the fatal ones makes it worse
        hit = set(fatal) & set(case.sensors)
        return 0.0 if len(hit) == len(fatal) else 1 - 0.2 * len(hit)

    config = WorstCases(times_s=(0.0,), max_cases=40, screening=10, trials=40)
    search = search_of(rate, 24, config)
    stopping = search.run()
    assert [trials.case.sensors for trials in stopping[:1]] == [fatal]
    assert search.whole == {1}
    assert len(search.tried) < 400  # of the 2300 triples alone


def test_the_time_between_those_of_the_grid_is_found_by_mutants() -> None:
    def rate(case: Case) -> float:
        return 0.0 if any(20.0 < time < 30.0 for time in case.times_s) else 0.9

    stopping = search_of(rate, 4, WorstCases(most=1, times_s=(0.0, 40.0), rounds=4)).run()
    assert stopping
    assert all(20.0 < time < 30.0 for trials in stopping for time in trials.case.times_s)


def test_noise_stops_no_design() -> None:
    """A design that fails in 30 % of its missions whatever happens; and one that always does."""
    config = WorstCases(most=2, times_s=(0.0,), rounds=0)
    for seed in range(12):
        assert not search_of(lambda case: 0.7, 5, config, seed).run()
        assert not search_of(lambda case: 0.0, 5, config, seed).run()  # not by the failure


def test_the_same_outcomes_give_the_same_search() -> None:
    config = WorstCases(most=3, max_cases=30)
    first, second = (search_of(needs(1, 2, 6), 9, config) for _ in range(2))
    assert [trials.case for trials in first.run()] == [trials.case for trials in second.run()]
    assert list(first.tried) == list(second.tried)


def test_a_design_without_sensors_has_no_case() -> None:
    search = search_of(lambda case: 0.5, 0, WorstCases())
    assert search.run() == []
    assert search.nominal.count("world")[1] == WorstCases().trials


def test_bad_settings_are_refused() -> None:
    with pytest.raises(InputError, match=r"worst_cases.latest_s: .* not 10"):
        WorstCases(times_s=(40.0,), latest_s=10.0)
