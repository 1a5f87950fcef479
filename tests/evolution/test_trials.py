"""Scores of trials with measures, their best candidate, and measures that distinguish nothing."""

from dataclasses import replace

import numpy as np
from fixture_types import Log
from hypothesis import given
from hypothesis import strategies as st

from evoros.evolution.scores import find_best
from evoros.evolution.trials import Measuring, list_values, read_score
from evoros.measure.cost import Cost
from evoros.measure.coverage import Coverage
from evoros.measure.sensor_number import SensorNumber
from evoros.optimizer.protocol import Candidate, Individual, Score
from evoros.testing.subjects import example_experiment


def test_a_score_is_read_again_from_its_values() -> None:
    experiment = replace(example_experiment(), objectives={"a": Cost(), "b": Coverage()})
    score = Score(3.5, (-7.25, 0.1), ())
    columns = dict(zip(("objectives.a", "objectives.b"), (7.25, 0.1), strict=True))
    assert list_values(experiment, score) == list(columns.values())
    assert read_score(experiment, {"fitness": 3.5, **columns}) == score


def test_a_descriptor_that_is_equal_for_several_designs_is_reported(caplog: Log) -> None:
    scores = {i: Score(float(i), (), (2.0,)) for i in range(3)}
    measuring = Measuring(replace(example_experiment(), descriptors={"one": SensorNumber()}))
    measuring.check_variety({0: scores[0]})
    measuring.check_variety({**scores, 3: Score(0.0, (), (4.0,))})
    assert not caplog.text
    measuring.check_variety({0: scores[0], 1: scores[1]})
    assert "descriptors.one: should differ" in caplog.text


FITNESS = st.floats(-24, 24)


@given(st.lists(st.tuples(FITNESS, st.booleans()), min_size=1, max_size=8))
def test_a_confirmed_candidate_wins_over_a_fitter_one_that_is_not(
    rows: list[tuple[float, bool]],
) -> None:
    candidates = [
        Candidate(Individual(i, np.zeros(1), (), "initial"), "survivor", fitness, 1)
        for i, (fitness, _) in enumerate(rows)
    ]
    confirmed = {i for i, (_, is_confirmed) in enumerate(rows) if is_confirmed}
    best = find_best(candidates, confirmed)
    rivals = [row for row in candidates if not confirmed or row.individual.id in confirmed]
    assert best in rivals
    assert best.fitness == max(row.fitness for row in rivals)
