"""Tests of one or two factors and their interaction, and intervals of contrasts.

Permutations of Welch's statistic (Pauly, Brunner and Konietschke 2015, J. R. Stat. Soc. B 77,
461-473) keep the significance level for cells that differ in size or variance and are not normal.
With ranks, main effects of skewed values would look like an interaction.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, product
from math import inf, nan

import numpy as np
import scipy

from evoros.base.arrays import Array

from . import two_samples
from .small_samples import LEVEL, NOTHING, RESAMPLES, SEED, Interval, Sample
from .two_samples import Places

TEST = "permuted Welch-James test"
CELLS = 2_000_000  # maximum number of values permuted at a time, to limit memory
DIGITS = 9  # decimals to which the statistic is rounded, so that ties agree on every processor
Cell = tuple[str, ...]  # one level per factor


@dataclass(frozen=True)
class EffectTest:
    """The test of an effect: F and degrees of freedom or, for two samples, A12."""

    effect: tuple[str, ...]  # one factor, or two factors for an interaction
    test: str
    p: float
    f: float = nan
    freedom: float = nan
    error_freedom: float = nan
    a12: Interval = NOTHING


@dataclass(frozen=True)
class Contrast:
    """A difference between the means of two levels, or between two such differences."""

    effect: tuple[str, ...]
    text: str
    interval: Interval


def permute_effects(
    values: Array, levels: Mapping[str, Sequence[str]], resamples: int = RESAMPLES
) -> list[EffectTest]:
    """Test the effect of each factor, and the interaction of two.

    ``levels`` maps each factor to the level of each value; each cell requires at least two values.
    In a main effect, the levels of the other factor have equal weights. The p-values depend neither
    on the order of the values nor on the names of the levels.
    """
    names, rows = list(levels), list(zip(*levels.values(), strict=True))
    cells = {
        cell: np.sort(values[[row == cell for row in rows]])
        for cell in product(*(dict.fromkeys(levels[name]) for name in names))
    }
    if len(cells) == 2:
        samples = list(cells.values())
        p, effect = two_samples.brunner_munzel(*samples), two_samples.a12_interval(*samples)
        return [EffectTest((names[0],), two_samples.TEST, p, a12=effect)]
    effects = [tuple(some) for n in range(len(names)) for some in combinations(names, n + 1)]
    return [_test(effect, names, cells, resamples) for effect in effects]


def _test(
    effect: tuple[str, ...], names: Sequence[str], cells: Mapping[Cell, Array], resamples: int
) -> EffectTest:
    keys = sorted(cells, key=lambda key: (cells[key].size, cells[key].tolist()))
    values = np.concatenate([cells[key] for key in keys])
    sizes = np.array([cells[key].size for key in keys])
    contrasts = np.ones((1, len(keys)))
    for place, name in enumerate(names):
        rows = _contrast_levels([key[place] for key in keys], name in effect)
        contrasts = (contrasts[:, None] * rows).reshape(-1, len(keys))
    if not np.ptp(values) > 1e-12 * max(1.0, float(np.abs(values).max())):
        return EffectTest(effect, TEST, 1.0, 0.0, len(contrasts), inf)

    def permute(sample: Array, axis: int = -1) -> Array:
        f, error = welch_james(np.moveaxis(sample, axis, -1), sizes, contrasts)
        p = scipy.special.fdtrc(len(contrasts), error, f)
        return np.asarray(np.round(-p, DIGITS))

    result = scipy.stats.permutation_test(
        (values,),
        permute,
        permutation_type="pairings",
        vectorized=True,
        n_resamples=resamples,
        batch=max(1, CELLS // values.size),
        alternative="greater",
        rng=np.random.default_rng(SEED),
    )
    f, error = map(float, welch_james(values, sizes, contrasts))
    return EffectTest(effect, TEST, float(result.pvalue), f, len(contrasts), error)


def _contrast_levels(levels: Sequence[str], compare: bool) -> Array:
    """Return contrasts of the first level with each other level, or the average over levels."""
    known = list(dict.fromkeys(levels))
    among = np.array([[level == other for level in levels] for other in known], float)
    rows = among[:1] - among[1:] if compare else among.sum(axis=0, keepdims=True) / len(known)
    return np.asarray(rows)


def welch_james(values: Array, sizes: Places, contrasts: Array) -> tuple[Array, Array]:
    """Return F and the error's degrees of freedom for contrasts (k, cells) of cell means.

    ``values`` (..., n) are ordered by cell. F has k degrees of freedom (Johansen 1980, Biometrika
    67, 85-92); for one factor, it is Welch's F (1951, Biometrika 38, 330-336).
    """
    starts, k = np.cumsum(sizes) - sizes, len(contrasts)
    means = np.add.reduceat(values, starts, axis=-1) / sizes
    deviations = values - np.repeat(means, sizes, axis=-1)
    variances = np.add.reduceat(deviations**2, starts, axis=-1) / (sizes - 1)
    least = 1e-12 * values.var(axis=-1, keepdims=True)  # keeps F finite for cells of equal values
    errors = np.maximum(variances, least) / sizes
    inverse = np.linalg.inv(np.einsum("ic,...c,jc->...ij", contrasts, errors, contrasts))
    differences = means @ contrasts.T
    statistic = np.einsum("...i,...ij,...j->...", differences, inverse, differences)
    shares = errors * np.einsum("ic,...ij,jc->...c", contrasts, inverse, contrasts)
    excess = (shares**2 / (sizes - 1)).sum(axis=-1)
    scale = k + 2 * excess - 6 * excess / (k + 2)
    return np.asarray(statistic / scale), np.asarray(k * (k + 2) / (3 * excess))


def list_contrasts(
    cells: Mapping[Cell, Array],
    levels: Mapping[str, Sequence[str]],
    bounds: tuple[float, float] = (-inf, inf),
) -> Iterator[Contrast]:
    """Yield contrasts of means by factor and interaction; cells have equal weights."""
    keys, samples = list(cells), list(cells.values())
    for place, (name, known) in enumerate(levels.items()):
        rest = len(keys) / len(known)
        for low, high in combinations(known, 2):
            weights = [((k[place] == high) - (k[place] == low)) / rest for k in keys]
            interval = contrast_interval(samples, weights, bounds)
            yield Contrast((name,), f"{high} - {low}", interval)
    if len(levels) == 2:
        first, second = (list(combinations(known, 2)) for known in levels.values())
        for (a, b), (c, d) in product(first, second):
            weights = [((k[0] == b) - (k[0] == a)) * ((k[1] == d) - (k[1] == c)) for k in keys]
            text = f"({b} - {a}) with {d} minus with {c}"
            yield Contrast(tuple(levels), text, contrast_interval(samples, weights, bounds))


def contrast_interval(
    cells: Sequence[Sample], weights: Sample, bounds: tuple[float, float] = (-inf, inf)
) -> Interval:
    """Return a weighted sum of cell means with its interval (Welch 1947, Biometrika 34, 28-35).

    ``bounds`` limit the interval, which is NaN if a cell has a single value or if no cell varies.
    """
    used = [(w, np.asarray(x, float)) for w, x in zip(weights, cells, strict=True) if w]
    value = float(sum(w * x.mean() for w, x in used))
    if min(x.size for _, x in used) < 2:
        return Interval(value)
    parts = [w * w * x.var(ddof=1) / x.size for w, x in used]
    total = float(sum(parts))
    if total == 0:
        return Interval(value)
    shares = ((part / total) ** 2 / (x.size - 1) for part, (_, x) in zip(parts, used, strict=True))
    freedom = 1 / sum(shares)
    half = float(scipy.stats.t.ppf(1 - LEVEL / 2, freedom)) * total**0.5
    lowest, highest = (
        float(sum(w * (bounds[end] if w > 0 else bounds[1 - end]) for w, _ in used))
        for end in (0, 1)
    )
    return Interval(value, max(value - half, lowest), min(value + half, highest))
