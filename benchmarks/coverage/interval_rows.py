"""Intervals of analyses: of one sample, and of two."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from numpy.random import Generator
from rows import MANY, SLOW, Row, Subject, Trial, postpone, within
from shapes import SHAPES, Shape, exceed

from evoros.analysis.statistics.factorial import contrast_interval
from evoros.analysis.statistics.power import Scatter, measure_scatter
from evoros.analysis.statistics.small_samples import (
    Interval,
    mean_interval,
    median_interval,
    ratio_interval,
    spearman,
)
from evoros.analysis.statistics.two_samples import a12_interval
from evoros.base.arrays import Array
from evoros.files.plugins import find_plugins

UNEQUAL = ((10, 10, 1.0), (5, 20, 1.0), (10, 10, 5.0), (30, 10, 5.0), (20, 5, 5.0))
"""Sizes of two groups, and the spread of the second relative to the first."""


def by_shape(
    make: Callable[..., Trial], *rest: Any, shapes: Sequence[Shape] = SHAPES
) -> dict[str, Trial]:
    """Return a trial for each shape, made of it and the other arguments."""
    return {shape.name: postpone(make, shape, *rest) for shape in shapes}


def name_groups(first: int, second: int, spread: float) -> str:
    """Name the sizes of two groups and their spreads."""
    return f"n = {first}, {second}; spreads 1 to {spread:g}"


def _cover(
    compute: Callable[[Array], Interval], truth: Callable[[Shape], float], sizes: Sequence[int]
) -> list[Row]:
    """Return rows of the interval of one sample."""

    def make(shape: Shape, n: int) -> Trial:
        def trial(rng: Generator) -> bool | None:
            interval = compute(shape.draw(rng, n))
            return within(interval.low, expected, interval.high)

        expected = truth(shape)
        return trial

    return [Row(f"n = {n}", by_shape(make, n)) for n in sizes]


def _contrast(shape: Shape, first: int, second: int, spread: float) -> Trial:
    other = replace(shape, spread=spread)
    truth = other.mean - shape.mean

    def trial(rng: Generator) -> bool | None:
        cells = [shape.draw(rng, first), other.draw(rng, second)]
        interval = contrast_interval(cells, [-1.0, 1.0])
        return within(interval.low, truth, interval.high)

    return trial


def _a12(shape: Shape, first: int, second: int, spread: float) -> Trial:
    other = replace(shape, spread=spread)
    truth = exceed(shape.values, other.values)

    def trial(rng: Generator) -> bool | None:
        interval = a12_interval(shape.draw(rng, first), other.draw(rng, second))
        return within(interval.low, truth, interval.high)

    return trial


def _ratio(shape: Shape, n: int) -> Trial:
    low = min(0.0, float(shape.values[0]))

    def trial(rng: Generator) -> bool | None:
        wholes = shape.draw(rng, n) - low
        interval = ratio_interval(wholes * rng.random(n), wholes)
        return within(interval.low, 0.5, interval.high)

    return trial


def _deviation(shape: Shape, groups: int, n: int) -> Trial:
    def trial(rng: Generator) -> bool | None:
        scatter = measure_scatter([shape.draw(rng, n) for _ in range(groups)])
        if scatter is None:
            return None
        return within(scatter.deviation.low, shape.deviation, scatter.deviation.high)

    return trial


@cache
def _distance(name: str) -> float:
    """The expected distance of two values."""
    (shape,) = (shape for shape in SHAPES if shape.name == name)
    ranks = 2 * np.arange(len(shape.values)) + 1 - len(shape.values)
    return float(2 * (ranks * shape.values).sum() / len(shape.values) ** 2)


def _spread(shape: Shape, n: int) -> Trial:
    from evoros.plugins.evo_ros_2018.claims_designs import relative_difference

    def trial(rng: Generator) -> bool | None:
        samples = [shape.draw(rng, n) for _ in range(2)]
        one, other = (np.abs(x[:, None] - x) for x in samples)
        interval = relative_difference(one, truth, other, truth)
        return within(interval.low, 0.0, interval.high)

    truth = _distance(shape.name)
    return trial


def _spearman(rho: float, n: int) -> Trial:
    truth = 6 / np.pi * np.arcsin(rho / 2)

    def trial(rng: Generator) -> bool | None:
        x, noise = rng.standard_normal((2, n))
        interval = spearman(x, rho * x + (1 - rho * rho) ** 0.5 * noise)
        return within(interval.low, truth, interval.high)

    return trial


def _list_groups(make: Callable[[Shape, int, int, float], Trial]) -> list[Row]:
    return [Row(name_groups(*group), by_shape(make, *group)) for group in UNEQUAL]


def _list_sizes(make: Callable[[Shape, int], Trial], sizes: Sequence[int]) -> list[Row]:
    return [Row(f"n = {n}", by_shape(make, n)) for n in sizes]


def _list_claims() -> Iterator[Subject]:
    """Yield the interval of the plug-in evo_ros_2018, if this is there."""
    if "evo_ros_2018" in find_plugins():
        from evoros.plugins.evo_ros_2018.claims_designs import mean_distance, relative_difference

        yield Subject(
            "difference of spreads of designs",
            "claims",
            [relative_difference, mean_distance],
            _list_sizes(_spread, (8, 20)),
            repetitions=SLOW,
        )


INTERVALS = (
    Subject(
        "mean, bootstrap",
        "strategies, transfer, claims",
        [mean_interval],
        _cover(mean_interval, lambda shape: shape.mean, (6, 10, 20, 40)),
        repetitions=SLOW,
    ),
    Subject(
        "median, exact",
        "compare, strategies, claims, report",
        [median_interval],
        _cover(median_interval, lambda shape: shape.median, (6, 10, 20)),
        repetitions=MANY,
    ),
    Subject(
        "ratio of sums, bootstrap",
        "claims",
        [ratio_interval],
        _list_sizes(_ratio, (6, 20)),
        repetitions=SLOW,
    ),
    Subject(
        "mean, Student",
        "factors",
        [contrast_interval],
        _cover(
            lambda values: contrast_interval([values], [1.0]), lambda shape: shape.mean, (5, 10, 40)
        ),
        repetitions=MANY,
    ),
    Subject(
        "difference of means, Welch",
        "factors, claims",
        [contrast_interval],
        _list_groups(_contrast),
        repetitions=MANY,
    ),
    Subject(
        "A12",
        "compare, claims",
        [a12_interval],
        _list_groups(_a12),
    ),
    Subject(
        "standard deviation",
        "power",
        [Scatter, measure_scatter],
        [
            Row(f"{groups} groups of {n}", by_shape(_deviation, groups, n))
            for groups, n in ((2, 6), (4, 10))
        ],
        repetitions=MANY,
    ),
    *_list_claims(),
    Subject(
        "rank correlation, bootstrap",
        "transfer",
        [spearman],
        [
            Row(f"n = {n}", {f"correlation {rho}": _spearman(rho, n) for rho in (0.0, 0.7, 0.95)})
            for n in (10, 40)
        ],
        repetitions=SLOW,
    ),
)
