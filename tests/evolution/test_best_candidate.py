"""The best candidate of a generation: confirmed ones first, then the fittest."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from evoros.evolution.scores import find_best
from evoros.optimizer.protocol import Candidate, Individual

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
