"""Tests of one or two factors and of their interaction, by permutation of residuals.

Freedman and Lane (1983), J. Bus. Econ. Stat. 1, 292-298: to test an effect, the residuals of the
model without it are permuted, and its F is compared with the F of the permutations. Nothing is
assumed of the shape of the distributions. The aligned-rank transform is not used: ranks make a
main effect of skewed values look like an interaction.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np
import scipy

from evoros.base.arrays import Array

from .effect_sizes import contrast_interval
from .small_samples import RESAMPLES, SEED, Interval

CELLS = 2_000_000
"""Values that are permuted at a time; a limit of memory."""
Cell = tuple[str, ...]
"""A level of each factor."""


@dataclass(frozen=True)
class EffectTest:
    """The test of an effect."""

    effect: tuple[str, ...]  # its factors; two are an interaction
    freedom: int
    error_freedom: int
    f: float
    p: float


@dataclass(frozen=True)
class Contrast:
    """A difference of means: of two levels, or of the differences at two levels of the other."""

    effect: tuple[str, ...]
    text: str
    interval: Interval


def permute_effects(
    values: Array, levels: Mapping[str, Sequence[str]], resamples: int = RESAMPLES
) -> list[EffectTest]:
    """Test the effect of each factor, and the interaction of two.

    ``levels`` has the level of each value by factor, of one or two factors. The sums of squares of
    the main effects are those of type II: each is what its factor adds to the other. ``values``
    need two or more in some cell, and values in all cells.

    Each p is from ``resamples`` permutations, of which the observed order is one.
    """
    names = list(levels)
    sets = [_code(levels[name]) for name in names]
    one = np.ones((values.size, 1))
    cells = np.hstack([one, *sets])
    if len(sets) == 2:
        cross = np.einsum("ni,nj->nij", *sets).reshape(values.size, -1)
        cells = np.hstack([cells, cross])
    tests = []
    for i, name in enumerate(names):
        others = [one, *(s for j, s in enumerate(sets) if j != i)]
        tests.append(_test((name,), values, (np.hstack(others), sets[i], cells), resamples))
    if len(sets) == 2:
        models = np.hstack([one, *sets]), cross, cells
        tests.append(_test(tuple(names), values, models, resamples))
    return tests


def _code(levels: Sequence[str]) -> Array:
    """Return a column for each level but the last: 1, and -1 for the last."""
    known = list(dict.fromkeys(levels))
    rows = np.array([known.index(level) for level in levels])
    coded = np.eye(len(known))[rows]
    return np.asarray(coded[:, :-1] - coded[:, -1:])


def _basis(columns: Array) -> Array:
    """Return an orthonormal basis of the space of columns."""
    left, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(left[:, sizes > 1e-9 * sizes.max()])


def _test(
    effect: tuple[str, ...], values: Array, models: tuple[Array, Array, Array], resamples: int
) -> EffectTest:
    """Test what columns add to the model without them, against the scatter in cells.

    ``models`` has the columns of the model without them, of the effect, and of the cells.
    """
    without, columns, cells = models
    reduced, full = _basis(without), _basis(cells)
    added = _basis(columns - reduced @ (reduced.T @ columns))
    freedom, error = added.shape[1], values.size - full.shape[1]
    residuals = values - reduced @ (reduced.T @ values)

    def compute_f(sample: Array, axis: int = -1) -> Array:
        rows = np.moveaxis(sample, axis, -1)
        explained = ((rows @ added) ** 2).sum(-1)
        scatter = (rows**2).sum(-1) - ((rows @ full) ** 2).sum(-1)
        scatter = np.maximum(scatter, 1e-12 * (rows**2).sum(-1))
        with np.errstate(invalid="ignore"):  # all values are equal: 0 / 0
            return np.asarray((explained / freedom) / (scatter / error))

    f = float(compute_f(residuals))
    if not np.ptp(residuals) > 1e-12 * max(1.0, float(np.abs(values).max())):
        return EffectTest(effect, freedom, error, 0.0, 1.0)
    result = scipy.stats.permutation_test(
        (residuals,),
        compute_f,
        permutation_type="pairings",
        vectorized=True,
        n_resamples=resamples,
        batch=max(1, CELLS // values.size),
        alternative="greater",
        rng=np.random.default_rng(SEED),
    )
    return EffectTest(effect, freedom, error, f, float(result.pvalue))


def list_contrasts(
    cells: Mapping[Cell, Array], levels: Mapping[str, Sequence[str]]
) -> Iterator[Contrast]:
    """Yield the differences of means by factor, and the interaction's; cells weigh the same."""
    keys = list(cells)
    samples = [cells[key] for key in keys]
    for place, (name, known) in enumerate(levels.items()):
        rest = len(keys) / len(known)
        for low, high in combinations(known, 2):
            weights = [((k[place] == high) - (k[place] == low)) / rest for k in keys]
            yield Contrast((name,), f"{high} - {low}", contrast_interval(samples, weights))
    if len(levels) == 2:
        first, second = (list(combinations(known, 2)) for known in levels.values())
        for (a, b), (c, d) in product(first, second):
            weights = [((k[0] == b) - (k[0] == a)) * ((k[1] == d) - (k[1] == c)) for k in keys]
            text = f"({b} - {a}) at {d} - at {c}"
            yield Contrast(tuple(levels), text, contrast_interval(samples, weights))
