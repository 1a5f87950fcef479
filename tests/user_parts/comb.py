"""A user's own sensor."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from evoros.base.arrays import Array
from evoros.filter.protocol import Filter
from evoros.sensor.protocol import Channel, RangeSensor


@dataclass(frozen=True)
class Comb(RangeSensor):
    """A sensor with a beam for each bearing, whose rays are listed from the last on."""

    bearings_deg: tuple[float, ...] = (-30.0, 0.0, 40.0)
    period_s: float = 0.1
    range_min_m: float = 0.0
    range_max_m: float = 3.0
    size_m: Sequence[float] = (0.01, 0.01, 0.01)
    mass_kg: float = 0.01
    price: float = 1.0
    filters: Mapping[str, Filter] = field(default_factory=dict)

    @property
    def channels(self) -> tuple[Channel, ...]:
        return (Channel("range", "m", self.range_min_m, self.range_max_m),) * len(self.bearings_deg)

    def rays(self) -> Array:
        angles = np.radians(self.bearings_deg[::-1])
        return np.column_stack((np.cos(angles), np.sin(angles), np.zeros(len(angles))))

    def channel_of(self) -> NDArray[np.int64]:
        return np.arange(len(self.bearings_deg))[::-1]
