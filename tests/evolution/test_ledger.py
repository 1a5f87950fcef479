"""The record of a run's individuals gives the same answers as keeping everything."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evoros.allocation.successive_rejects import SuccessiveRejects
from evoros.certificate.final_choice import FinalChoice
from evoros.evolution.scores import Ledger, NumberLog
from evoros.optimizer.protocol import Individual

NUMBERS = st.floats(allow_nan=False)


@given(st.lists(st.tuples(st.integers(0, 9), NUMBERS, NUMBERS)))
def test_a_log_finds_the_rows_of_each_individual_in_their_order(
    rows: list[tuple[int, float, float]],
) -> None:
    log = NumberLog(2)
    for individual, *row in rows:
        log.add(individual, row)
    expected = {design_id: [row for i, *row in rows if i == design_id] for design_id in range(10)}
    assert log.find(range(10)) == expected
    seen = {individual for individual, *_ in rows}
    assert log.find_last(seen) == {design_id: expected[design_id][-1] for design_id in seen}


def test_a_log_can_grow_after_it_was_read() -> None:
    log = NumberLog(1)
    for row in range(100):
        log.add(1, [row])
        assert log.find_last([1]) == {1: [row]}


def test_rows_are_found_among_many() -> None:
    log = NumberLog(1)
    for row in range(9000):
        log.add(row % 5000, [row])
    assert log.find([0, 4999]) == {0: [[0], [5000]], 4999: [[4999]]}
    assert log.find([-1]) == {-1: []}


def test_a_log_refuses_a_row_of_another_width() -> None:
    with pytest.raises(ValueError, match="must have 2 numbers, not 1"):
        NumberLog(2).add(0, [1.0])


@given(st.data())
def test_the_finalists_are_those_of_a_ledger_that_forgets_nobody(data: st.DataObject) -> None:
    final = FinalChoice(SuccessiveRejects(budget=1), finalists=data.draw(st.integers(1, 4)))
    ledger, told = Ledger(0, final), dict[int, float]()
    alive: list[Individual] = []
    for generation in range(data.draw(st.integers(1, 6))):
        new = [Individual(3 * generation + i, np.zeros(1), (), "initial") for i in range(3)]
        for individual in [*new, *alive]:  # survivors are scored again
            told[individual.id] = data.draw(st.integers(0, 5))
            ledger.told.add(individual.id, [told[individual.id]])
        ledger.keep_finalists([*new, *alive])
        kept = ledger.find_fitness(ledger.finalists)
        assert final.find_finalists(kept) == final.find_finalists(told)
        alive = data.draw(st.lists(st.sampled_from([*new, *alive]), unique_by=id))
