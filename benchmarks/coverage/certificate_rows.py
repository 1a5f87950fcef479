"""Intervals of a champion's fitness, and its rivals."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from interval_rows import by_shape
from numpy.random import Generator
from rows import FEW, SLOW, Row, Subject, Trial, postpone, within
from shapes import Shape

from evoros.base.arrays import Array
from evoros.certificate.rates import Bounds, bound_mean, share_level
from evoros.certificate.validation import Validation, list_looks
from evoros.fitness.worst_case import bound_lowest

LIMIT_S = 540.0


class Champion(NamedTuple):
    """How often it completes each world, and in which share of missions in half the time."""

    completed: tuple[float, float, float]
    quick: float = 0.0


CHAMPIONS = {
    "80 %": Champion((0.8, 0.8, 0.8)),
    "95 %": Champion((0.95, 0.95, 0.95)),
    "98 %": Champion((0.98, 0.98, 0.98)),
    "99 %": Champion((0.99, 0.99, 0.99)),
    "100, 100, 90 %": Champion((1.0, 1.0, 0.9)),
    "100 %": Champion((1.0, 1.0, 1.0)),
    "100 %, 2 % in half the time": Champion((1.0, 1.0, 1.0), 0.02),
}
LOWEST, HIGHEST, MISSIONS = 3.0, 24.0, 3
SHARE = 0.25


def draw_scores(rng: Generator, n: int, champion: Champion) -> Array:
    """Draw Equation 1 (n, 3) of three worlds, completed in about 380 s.

    Each counts as if it were the same in all worlds.
    """
    done = rng.random((n, MISSIONS)) < np.array(champion.completed)
    times_s = np.clip(rng.normal(380.0, 6.0, (n, MISSIONS)), 300.0, LIMIT_S)
    left = 2 - np.where(rng.random((n, MISSIONS)) < champion.quick, 0.5, 1) * times_s / LIMIT_S
    lost = (1 + rng.uniform(0, 0.9, (n, MISSIONS))) ** 2
    return np.asarray(MISSIONS * np.where(done, 4 + left**2, lost))


def _expect(champion: Champion) -> float:
    return float(draw_scores(np.random.default_rng(1), 200_000, champion).mean())


def _bound(scores: Array, confidence: float) -> Bounds:
    return bound_mean(scores.ravel().tolist(), LOWEST, HIGHEST, confidence)


def _by_champion(make: Callable[..., Trial], *rest: Any) -> dict[str, Trial]:
    return {name: postpone(make, champion, *rest) for name, champion in CHAMPIONS.items()}


def _certificate(champion: Champion, n: int) -> Trial:
    truth = _expect(champion)

    def trial(rng: Generator) -> bool | None:
        low, high = _bound(draw_scores(rng, n, champion), 0.95)
        return within(low, truth, high)

    return trial


def _precise(champion: Champion, precision: float) -> Trial:
    truth, validation = _expect(champion), Validation(precision=precision)
    looks = list_looks(validation, 5, MISSIONS, (truth - LOWEST, HIGHEST - truth))
    confidence = share_level(validation.confidence, len(looks))

    def trial(rng: Generator) -> bool | None:
        scores = draw_scores(rng, looks[-1], champion)
        for count in looks:
            low, high = _bound(scores[:count], confidence)
            if high - low <= 2 * precision:
                break
        return within(low, truth, high)

    return trial


def _advantage(champion: Champion, rivals: int, n: int) -> Trial:
    """By how much equal rivals are better, at most."""

    def trial(rng: Generator) -> bool | None:
        low, _ = _bound(draw_scores(rng, n, champion), 0.95)
        ends = [_bound(draw_scores(rng, n, champion), 1 - 0.05 / rivals) for _ in range(rivals)]
        return within(0.0, 0.0, max(high for _, high in ends) - low)

    return trial


def _worst_case(shape: Shape, n: int) -> Trial:
    truth, limits = shape.mean_lowest(SHARE), shape.bounds

    def trial(rng: Generator) -> bool | None:
        low, high = bound_lowest(shape.draw(rng, n).tolist(), SHARE, limits, 0.95)
        return within(low, truth, high)

    return trial


CERTIFICATES = (
    Subject(
        "fitness of a champion that completes so many missions",
        "certificate",
        [bound_mean],
        [Row(f"n = {n}", _by_champion(_certificate, n)) for n in (5, 10, 40, 100)],
        repetitions=SLOW,
    ),
    Subject(
        "the same, validation.precision=0.5",
        "certificate",
        [list_looks, share_level, Validation],
        [Row("5 to 200 trials", _by_champion(_precise, 0.5))],
        repetitions=FEW,
    ),
    Subject(
        "by how much a rival may be better",
        "certificate",
        [bound_mean],
        [Row("14 equal rivals, n = 10", _by_champion(_advantage, 14, 10))],
        repetitions=FEW,
    ),
    Subject(
        "fitness=worst_case of a champion",
        "certificate",
        [bound_lowest],
        [Row(f"n = {n}", by_shape(_worst_case, n)) for n in (5, 10, 20, 40, 200)],
        repetitions=500,
    ),
)
