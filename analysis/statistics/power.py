"""How many replicates detect a difference: simulations from the replicates at hand."""

from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
import scipy

from evoros.base.arrays import Array

from .small_samples import LEVEL, SEED, Interval, mann_whitney

SAMPLES = 2000
"""Simulated comparisons; a power has a standard error of 1.1 % at most."""
MAX_REPLICATES = 200
MIN_SCATTER = 3
"""Values with which a treatment counts, and that there must be in all."""


@dataclass(frozen=True)
class Scatter:
    """How the replicates of treatments scatter about their means."""

    residuals: Array  # of all treatments
    treatments: int

    @property
    def freedom(self) -> int:
        """Degrees of freedom of the standard deviation."""
        return self.residuals.size - self.treatments

    @cached_property
    def deviation(self) -> Interval:
        """The standard deviation and its interval, by the chi-squared distribution."""
        sum_of_squares = float((self.residuals**2).sum())
        bounds = scipy.stats.chi2.ppf([1 - LEVEL / 2, LEVEL / 2], self.freedom)
        low, high = (float((sum_of_squares / bound) ** 0.5) for bound in bounds)
        return Interval(float((sum_of_squares / self.freedom) ** 0.5), low, high)


def measure_scatter(groups: Sequence[Array]) -> Scatter | None:
    """Pool the deviations from the means of groups of two or more; None if they do not vary."""
    known = [group for group in groups if group.size > 1]
    residuals = [group - group.mean() for group in known]
    scatter = Scatter(np.concatenate([*residuals, np.empty(0)]), len(known))
    enough = scatter.freedom >= MIN_SCATTER - 1
    return scatter if enough and np.ptp(scatter.residuals) > 0 else None


@dataclass(frozen=True)
class Simulation:
    """Pairs of simulated treatments, of which the first n replicates are compared at a time.

    Replicates are drawn by a smoothed bootstrap (Silverman and Young 1987, Biometrika 74, 469-479):
    residuals with replacement, with normal noise so that none is drawn twice, and with the
    variance of the residuals as estimated.
    """

    scatter: Scatter
    comparisons: int  # over which p is adjusted
    samples: int = SAMPLES

    @cached_property
    def _noise(self) -> tuple[Array, Array]:
        """Two treatments without difference, of standard deviation 1."""
        rng = np.random.default_rng(SEED)
        residuals = self.scatter.residuals / self.scatter.residuals.std()
        width = 1.06 * residuals.size**-0.2
        shape = (2, self.samples, MAX_REPLICATES)
        drawn = rng.choice(residuals, shape) + width * rng.standard_normal(shape)
        first, second = drawn / (1 + width * width) ** 0.5
        return first, second

    def compute_power(self, difference: float, n: int) -> float:
        """Return the share of comparisons of n replicates that find a difference [deviations].

        p is adjusted as the smallest of all pairs is by Holm: the most that can be asked of a pair.
        """
        first, second = (noise[:, :n] for noise in self._noise)
        ranks = scipy.stats.rankdata(np.hstack([first + difference, second]), axis=1)
        u = ranks[:, :n].sum(axis=1) - n * (n + 1) / 2
        critical = find_critical(n, LEVEL / self.comparisons)
        return float(np.mean(np.minimum(u, n * n - u) <= critical))

    def find_replicates(self, difference: float, power: float) -> float:
        """Return the minimum of replicates with this power; infinity: beyond ``MAX_REPLICATES``."""

        numbers = range(1, MAX_REPLICATES + 1)  # 1 is too few
        index = bisect_left(numbers, power, 1, key=lambda n: self.compute_power(difference, n))
        return numbers[index] if index < len(numbers) else np.inf


@cache
def find_critical(n: int, level: float) -> int:
    """Return the greatest U of two samples of n values without ties below a level of p, or -1."""

    def compute_p(u: int) -> float:
        """Return p of samples of which u pairs have the greater value in the first."""
        whole, rest = divmod(u, n)
        second: Array = np.arange(n, dtype=np.float64) + 0.5
        above = [n] * whole + ([rest] if whole < n else []) + [0] * (n - whole - 1)
        first: Array = np.array(above[:n], dtype=np.float64) + np.arange(n) * 1e-6
        return mann_whitney(first, second)

    return bisect_left(range(n * n // 2 + 1), level, key=compute_p) - 1


def plan_replicates(
    simulation: Simulation, differences: Sequence[float], power: float
) -> Iterator[Mapping[str, float]]:
    """Yield the replicates that each difference needs, with bounds by the deviation's interval."""
    deviation = simulation.scatter.deviation
    for difference in differences:
        needed = [
            simulation.find_replicates(difference / size, power)
            for size in (deviation.value, deviation.low, deviation.high)
        ]
        yield {
            "difference": difference,
            "in_sd": difference / deviation.value,
            **dict(zip(("replicates", "replicates_low", "replicates_high"), needed, strict=True)),
        }
