"""Distributions whose mean, median and lowest part are known, from which samples are drawn."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy
from numpy.random import Generator

from evoros.base.arrays import Array

GRID = (np.arange(100_000) + 0.5) / 100_000
"""Probabilities at whose quantiles expectations are computed."""


@dataclass(frozen=True)
class Shape:
    """A distribution by its quantile function, stretched about its mean by ``spread``."""

    name: str
    quantile: Callable[[Array], Array]
    bounds: tuple[float, float] = (0.0, 24.0)  # as a fitness may state them
    spread: float = 1.0
    shift: float = 0.0

    @cached_property
    def values(self) -> Array:
        """The quantiles at ``GRID``, ascending."""
        return self._stretch(self.quantile(GRID))

    @cached_property
    def _centre(self) -> float:
        return float(self.quantile(GRID).mean())

    def _stretch(self, values: Array) -> Array:
        return self._centre + self.shift + self.spread * (values - self._centre)

    @property
    def mean(self) -> float:
        """The expectation."""
        return float(self.values.mean())

    @property
    def deviation(self) -> float:
        """The standard deviation."""
        return float(self.values.std())

    @property
    def median(self) -> float:
        """The median."""
        return float(self._stretch(self.quantile(np.array([0.5])))[0])

    def mean_lowest(self, share: float) -> float:
        """Return the mean of the lowest share, the conditional value at risk."""
        return float(self.values[: round(share * len(GRID))].mean())

    def draw(self, rng: Generator, *size: int) -> Array:
        """Draw independent values."""
        return self._stretch(self.quantile(rng.random(size)))


def _normal(u: Array) -> Array:
    return np.asarray(10.0 + scipy.special.ndtri(u))


def _lognormal(u: Array) -> Array:
    return np.asarray(np.exp(scipy.special.ndtri(u)))


def _bimodal(u: Array) -> Array:
    """Seven of ten about 0, three about 5."""
    low = 0.3 * scipy.special.ndtri(np.minimum(u / 0.7, 1 - 1e-12))
    high = 5.0 + 0.3 * scipy.special.ndtri(np.maximum((u - 0.7) / 0.3, 1e-12))
    return np.asarray(np.where(u < 0.7, low, high))


def _rare(u: Array) -> Array:
    """One of a hundred from 3 to 12, all others about 17.5."""
    high = 17.5 + 0.1 * scipy.special.ndtri(np.maximum((u - 0.01) / 0.99, 1e-12))
    return np.asarray(np.where(u < 0.01, 3.0 + 900.0 * u, high))


SHAPES = (
    Shape("normal", _normal),
    Shape("lognormal", _lognormal, (0.0, 200.0)),
    Shape("bimodal", _bimodal, (-3.0, 24.0)),
    Shape("1 in 100", _rare, (3.0, 24.0)),
)


def spread_equally_likely(shape: Shape, spread: float) -> Shape:
    """Return the shape with another spread, shifted so that either is greater equally often."""
    wide = replace(shape, spread=spread)

    def excess(shift: float) -> float:
        return exceed(wide.values + shift, shape.values) - 0.5

    reach = 10 * max(1.0, spread) * shape.deviation
    shift = float(scipy.optimize.brentq(excess, -reach, reach, xtol=1e-9))
    return replace(wide, shift=shift)


def exceed(x: Array, y: Array) -> float:
    """Return the chance that one of the ascending values exceeds the other; ties count half."""
    below = np.searchsorted(y, x, "left") + np.searchsorted(y, x, "right")
    return float(below.mean() / 2 / len(y))
