"""Expected scores of sets of sensors that fail, from the score of each set without a failure.

A set of n places is a number from 0 to 2^n - 1 whose bit i is place i, and scores are a vector with
one score for each set; some functions also take a row for each trial. If a failed sensor is silent
from the start, and silence is as good as no sensor, then a set with failed sensors scores as the
set of its survivors. So each expectation below is a weighted sum of the given scores, without an
error of its own.
"""

from collections.abc import Callable
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from evoros.base.arrays import Array

Sets = NDArray[np.int64]


def count_places(scores: Array) -> int:
    """Return the number of places."""
    return int(scores.shape[-1]).bit_length() - 1


def count_sensors(places: int) -> Sets:
    """Return the number of sensors of each set."""
    return np.array([members.bit_count() for members in range(1 << places)])


def list_members(members: int) -> list[int]:
    """List the places of a set."""
    return [place for place in range(members.bit_length()) if members >> place & 1]


def drop_out(scores: Array, rate: float) -> Array:
    """Return the expected score of each set if each sensor fails with ``rate``, independently.

    Place by place: a set with a sensor there keeps it with 1 - rate, and is otherwise the set
    without it. Scores may have a row for each trial.
    """
    expected = np.array(scores, float)
    for place in range(count_places(scores)):
        halves = expected.reshape(-1, 2, 1 << place)  # a view: without the place, and with it
        halves[:, 1] = (1.0 - rate) * halves[:, 1] + rate * halves[:, 0]
    return expected


def back_up(scores: Array, rate: float) -> Array:
    """Return the expected score of the robot with all places, for each set that has a backup.

    A place with a backup, which sees the same, is lost only if both sensors fail.
    """
    bits = np.arange(scores.shape[-1])[:, None] >> np.arange(count_places(scores)) & 1
    kept = 1.0 - rate ** (1.0 + bits)[:, None]  # of each place, by the set of backups
    weights = np.where(bits[None], kept, 1.0 - kept).prod(axis=2)  # of the sets of survivors
    return np.asarray(scores @ weights.T)


def fail_one(scores: Array) -> Array:
    """Return the expected score of each set if one of its sensors fails, each as probably."""
    return _without_each(scores, np.mean)


def fail_worst(scores: Array) -> Array:
    """Return the score of each set if the sensor fails whose failure costs most."""
    return _without_each(scores, np.min)


def _without_each(scores: Array, combine: Callable[[Array], np.floating]) -> Array:
    """Combine the scores of each set without one of its sensors; the empty set keeps its own."""
    combined = np.array(scores, float)
    for members in range(1, len(scores)):
        combined[members] = combine(scores[[members ^ 1 << i for i in list_members(members)]])
    return combined


def make_fit(places: int, fitted: Sets) -> Array:
    """Return the matrix that maps all scores to a pairwise approximation, which uses some of them.

    The approximation is a constant, a weight of each place and one of each pair of places, by least
    squares. With the sets ``near`` one, it is the expansion around this set to second order.
    """
    bits = np.arange(1 << places)[:, None] >> np.arange(places) & 1
    pairs = [bits[:, i] * bits[:, j] for i, j in combinations(range(places), 2)]
    terms = np.column_stack([np.ones(1 << places), bits, *pairs])
    matrix = np.zeros((1 << places, 1 << places))
    matrix[:, fitted] = terms @ np.linalg.pinv(terms[fitted])
    return matrix


def near(places: int, around: int) -> Sets:
    """Return the sets that differ from one by at most two places."""
    return np.flatnonzero(count_sensors(places)[np.arange(1 << places) ^ around] <= 2)


def within(places: int, budget: int) -> Sets:
    """Return the sets of at most so many sensors, and of at least one."""
    sensors = count_sensors(places)
    return np.flatnonzero((sensors > 0) & (sensors <= budget))


def find_best(scores: Array, budget: int) -> int:
    """Return the best set of at most so many sensors, and of at least one."""
    sets = within(count_places(scores), budget)
    return int(sets[np.argmax(scores[sets])])
