"""What faults do to readings is told from the filters alone, also from a user's own."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pytest

from evoros.base.arrays import NO_MEMORY, Array, RuleArrays
from evoros.filter.bias import Bias
from evoros.filter.delay import Delay
from evoros.filter.drift import Drift
from evoros.filter.dropout import Dropout
from evoros.filter.gaussian_noise import GaussianNoise
from evoros.filter.growing_noise import GrowingNoise
from evoros.filter.hold import Hold
from evoros.filter.protocol import Channels, Filter
from evoros.filter.scale import Scale
from evoros.filter.silence import Silence
from evoros.filter.stuck import Stuck
from evoros.storage.fault_effects import ALTERS, ENDS, GROWS, classify_effect

CHANNELS = Channels(
    np.full(3, 0.06), np.full(3, 4.5), np.zeros((3, 3)), 0.1, ("range", "range", "rate")
)


@dataclass(frozen=True)
class Fading:
    """Noise that grows with the time since the onset, for ever, or until readings end."""

    name: ClassVar[str] = "Fading"
    sigma_per_s: float = 0.01
    broken: bool = False

    def start(self, channels: Channels, onset: Array, rng: np.random.Generator) -> RuleArrays:
        if self.broken:
            raise ValueError("broken")
        return np.concatenate(([self.sigma_per_s], onset)), NO_MEMORY

    @staticmethod
    def rule(parameters: Array, memory: Array, rng: Any, values: Array, time: float) -> None:
        for i in range(len(values)):
            deviate = rng.standard_normal()
            if time >= parameters[1 + i]:
                values[i] += parameters[0] * (time - parameters[1 + i]) * deviate


@pytest.mark.parametrize(
    ("effect", "expected"),
    [
        (Silence(), ENDS),
        (Stuck(), ENDS),
        (Dropout(1.0), ENDS),
        (Dropout(0.02), ALTERS),
        (Bias(0.3), ALTERS),
        (Bias(0.3, of="rate"), ALTERS),
        (GaussianNoise(0.05), ALTERS),
        (GrowingNoise(0.001, 0.05), ALTERS),  # with the range, not with time
        (Scale(0.1), ALTERS),
        (Delay(), ALTERS),
        (Hold(), ALTERS),
        (Drift(0.01, 0.0), GROWS),
        (Drift(0.01, 0.0, of="rate"), GROWS),
        (Fading(), GROWS),
        (Fading(broken=True), ENDS),
    ],
)
def test_an_effect_is_what_it_does_to_readings(effect: Filter, expected: str) -> None:
    assert classify_effect(effect, CHANNELS) == expected
