"""Tests of differences, where there is none."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import combinations

import numpy as np
from interval_rows import UNEQUAL, by_shape, name_groups
from numpy.random import Generator
from rows import MANY, SLOW, Row, Subject, Trial
from shapes import SHAPES, Shape, spread_equally_likely

from evoros.analysis.designs.clusters import compare_with_samples, cut_best, find_clusters
from evoros.analysis.statistics.factorial import permute_effects
from evoros.analysis.statistics.regression import sign_flips
from evoros.analysis.statistics.small_samples import LEVEL, holm
from evoros.analysis.statistics.two_samples import brunner_munzel

CELLS = (("0", "0"), ("0", "1"), ("1", "0"), ("1", "1"))
LAYOUTS: Mapping[str, tuple[tuple[int, ...], tuple[float, ...]]] = {
    "cells of 8": ((8, 8, 8, 8), (1, 1, 1, 1)),
    "cells of 15, 4, 6, 10": ((15, 4, 6, 10), (1, 1, 1, 1)),
    "cells of 8; spreads 1, 1, 4, 4": ((8, 8, 8, 8), (1, 1, 4, 4)),
    "cells of 16, 16, 4, 4; spreads 1, 1, 4, 4": ((16, 16, 4, 4), (1, 1, 4, 4)),
}
RESAMPLES = 499


def _two_groups(shape: Shape, first: int, second: int, spread: float) -> Trial:
    other = spread_equally_likely(shape, spread) if spread != 1 else shape

    def trial(rng: Generator) -> bool:
        return brunner_munzel(shape.draw(rng, first), other.draw(rng, second)) < LEVEL

    return trial


def _family(shape: Shape, treatments: int, n: int) -> Trial:
    """Whether any of the pairs is found to differ."""

    def trial(rng: Generator) -> bool:
        groups = [shape.draw(rng, n) for _ in range(treatments)]
        return min(holm([brunner_munzel(x, y) for x, y in combinations(groups, 2)])) < LEVEL

    return trial


def _factors(shape: Shape, layout: str, effect: tuple[str, ...]) -> Trial:
    sizes, spreads = LAYOUTS[layout]
    labels = [cell for cell, size in zip(CELLS, sizes, strict=True) for _ in range(size)]
    levels = {name: [label[place] for label in labels] for place, name in enumerate("AB")}
    cells = [replace(shape, spread=spread) for spread in spreads]

    def trial(rng: Generator) -> bool:
        values = [cell.draw(rng, size) for cell, size in zip(cells, sizes, strict=True)]
        tests = permute_effects(np.concatenate(values), levels, RESAMPLES)
        (test,) = (test for test in tests if test.effect == effect)
        return test.p < LEVEL

    return trial


def _paired(shape: Shape, n: int, spread: float) -> Trial:
    other = replace(shape, spread=spread)

    def trial(rng: Generator) -> bool:
        return sign_flips(other.draw(rng, n) - shape.draw(rng, n)) < LEVEL

    return trial


def _clusters(shape: Shape, n: int) -> Trial:
    def trial(rng: Generator) -> bool:
        return find_clusters(shape.draw(rng, n, 2), 99).p < LEVEL

    return trial


def _samples(shape: Shape, n: int) -> Trial:
    def trial(rng: Generator) -> bool:
        pool = shape.draw(rng, 5 * n, 2)
        silhouette, _ = cut_best(shape.draw(rng, n, 2))
        return compare_with_samples(silhouette, n, pool, 99) < LEVEL

    return trial


def _rows(make: Callable[[Shape, str, tuple[str, ...]], Trial], *effect: str) -> list[Row]:
    return [
        Row(layout, by_shape(make, layout, effect, shapes=_seen(max(spreads))))
        for layout, (_, spreads) in LAYOUTS.items()
    ]


def _seen(spread: float) -> tuple[Shape, ...]:
    """Return the shapes whose means are equal to the eye if their spreads differ so much.

    Of those that differ one time in a hundred, few values show something else than the mean.
    """
    return SHAPES if spread == 1 else SHAPES[:-1]


ONE_CLOUD = SHAPES[:1]

TESTS = (
    Subject(
        "two groups differ, Brunner-Munzel",
        "compare, strategies, claims",
        [brunner_munzel],
        [Row(name_groups(*group), by_shape(_two_groups, *group)) for group in UNEQUAL],
        is_interval=False,
        repetitions=MANY,
    ),
    Subject(
        "any pair of treatments differs, Holm",
        "compare, strategies",
        [holm],
        [Row("4 treatments of 8", by_shape(_family, 4, 8))],
        is_interval=False,
    ),
    Subject(
        "a factor has an effect",
        "factors",
        [permute_effects],
        _rows(_factors, "A"),
        is_interval=False,
        repetitions=500,
    ),
    Subject(
        "two factors interact",
        "factors",
        [permute_effects],
        _rows(_factors, "A", "B"),
        is_interval=False,
        repetitions=500,
    ),
    Subject(
        "paired values change (sign-flip test)",
        "regression",
        [sign_flips],
        [
            Row(
                f"n = {n}; spreads 1 to {spread:g}",
                by_shape(_paired, n, spread, shapes=_seen(spread)),
            )
            for n, spread in ((10, 1.0), (40, 1.0), (10, 5.0), (40, 5.0))
        ],
        is_interval=False,
        repetitions=SLOW,
    ),
    Subject(
        "designs form clusters",
        "strategies",
        [find_clusters],
        [Row("n = 10", by_shape(_clusters, 10, shapes=ONE_CLOUD))],
        is_interval=False,
        repetitions=SLOW,
    ),
    Subject(
        "clusters are tighter than of random designs",
        "strategies",
        [compare_with_samples],
        [Row("n = 10", by_shape(_samples, 10, shapes=ONE_CLOUD))],
        is_interval=False,
        repetitions=SLOW,
    ),
)
