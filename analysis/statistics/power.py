"""The number of replicates required to detect a difference, simulated from given replicates."""

from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from evoros.base.arrays import Array

from .small_samples import LEVEL, SEED, Interval
from .two_samples import compute_statistics, find_critical

SAMPLES = 2000  # number of simulated comparisons; limits the standard error of the power to 1.1 %
MAX_REPLICATES = 200
MIN_SCATTER = 3  # minimum replicates of a single treatment; several treatments pool residuals


@dataclass(frozen=True)
class Scatter:
    """Deviations of replicates from their treatments' means."""

    residuals: Array  # pooled over treatments
    treatments: int  # number of treatments

    @property
    def freedom(self) -> int:
        """The degrees of freedom of the standard deviation."""
        return self.residuals.size - self.treatments

    @cached_property
    def deviation(self) -> Interval:
        """The standard deviation and its chi-squared interval, which assumes normal values."""
        sum_of_squares = float((self.residuals**2).sum())
        bounds = scipy.stats.chi2.ppf([1 - LEVEL / 2, LEVEL / 2], self.freedom)
        low, high = (float((sum_of_squares / bound) ** 0.5) for bound in bounds)
        return Interval(float((sum_of_squares / self.freedom) ** 0.5), low, high)


def measure_scatter(groups: Sequence[Array]) -> Scatter | None:
    """Pool deviations from the means of groups of two or more; None if too few or all equal."""
    known = [group for group in groups if group.size > 1]
    residuals = [group - group.mean() for group in known]
    scatter = Scatter(np.concatenate([*residuals, np.empty(0)]), len(known))
    enough = scatter.freedom >= MIN_SCATTER - 1
    return scatter if enough and np.ptp(scatter.residuals) > 0 else None


@dataclass(frozen=True)
class Simulation:
    """Simulated pairs of treatments; a comparison uses the first n replicates of each pair.

    The pairs come from a smoothed bootstrap (Silverman and Young 1987, Biometrika 74, 469-479).
    """

    scatter: Scatter
    comparisons: int  # number of comparisons for which p-values are adjusted
    samples: int = SAMPLES

    @cached_property
    def _noise(self) -> tuple[Array, Array]:
        rng = np.random.default_rng(SEED)
        residuals = self.scatter.residuals / self.scatter.residuals.std()
        width = 1.06 * residuals.size**-0.2
        shape = (2, self.samples, MAX_REPLICATES)
        drawn = rng.choice(residuals, shape) + width * rng.standard_normal(shape)
        first, second = drawn / (1 + width * width) ** 0.5
        return first, second

    def compute_power(self, difference: float, n: int) -> float:
        """Return the power for a difference [sd] with n replicates, after Holm's correction."""
        first, second = (noise[:, :n] for noise in self._noise)
        statistics = compute_statistics(first + difference, second)
        low, high = find_critical(n, LEVEL / self.comparisons)
        return float(np.mean((statistics < low) | (statistics > high)))

    def find_replicates(self, difference: float, power: float) -> float:
        """Return the minimum number of replicates for a power; infinity beyond the maximum."""

        numbers = range(1, MAX_REPLICATES + 1)  # the search starts at 2
        index = bisect_left(numbers, power, 1, key=lambda n: self.compute_power(difference, n))
        return numbers[index] if index < len(numbers) else np.inf


def plan_replicates(
    simulation: Simulation, differences: Sequence[float], power: float
) -> Iterator[Mapping[str, float]]:
    """Yield the replicates required for each difference, and for both bounds of the deviation."""
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
