"""A multizone range finder: adjacent zones that each read their nearest hit."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from evoros.base.arrays import Array
from evoros.base.checks import COUNT, NOT_NEGATIVE, POSITIVE, checked
from evoros.compilation.elementary_arrays import cos_all, sin_all
from evoros.filter.protocol import FILTERS, Filter
from evoros.sensor.gazebo_rays import Fan, gazebo_rays
from evoros.sensor.protocol import BEAM, BOX, RangeSensor, find_field, spread_bearings


@dataclass(frozen=True)
@checked
class Multizone(RangeSensor):
    """A range sensor whose field of view in the x-y plane is divided into equal ``zones``.

    Zones adjoin like the pixels of a camera, and are ordered from right to left. With
    ``conf/sensor/multizone.yaml``, the defaults are close to the middle row of ST's VL53L5CX.
    """

    radiation = "infrared"  # radiation type in ROS messages
    range_min_m: Annotated[float, NOT_NEGATIVE] = 0.02
    range_max_m: Annotated[float, POSITIVE] = 4.0
    fov_deg: Annotated[float, BEAM] = 45.0  # full width of all zones together
    zones: Annotated[int, replace(COUNT, limit=1000)] = 8
    rays_per_zone: Annotated[int, replace(COUNT, limit=100)] = 5
    period_s: Annotated[float, POSITIVE] = 0.1  # time between readings
    size_m: Annotated[Sequence[float], BOX] = (0.005, 0.013, 0.005)
    mass_kg: Annotated[float, POSITIVE] = 0.002
    base_price: Annotated[float, NOT_NEGATIVE] = 1.0
    zone_price: Annotated[float, NOT_NEGATIVE] = 1.0
    filters: Annotated[Mapping[str, Filter], FILTERS] = field(default_factory=dict)  # order matters

    @property
    def price(self) -> float:  # type: ignore[override]
        """The price of a sensor, which grows with the number of zones."""
        return self.base_price + self.zone_price * self.zones

    def channel_of(self) -> NDArray[np.int64]:
        return np.repeat(np.arange(self.zones), self.rays_per_zone)

    def rays(self) -> Array:
        count = self.zones * self.rays_per_zone
        angles = spread_bearings(count, self.fov_deg, count)  # centres of equal parts
        return np.column_stack((cos_all(angles), sin_all(angles), np.zeros(count)))

    def gazebo(self, name: str) -> str:
        fan = Fan(self.zones * self.rays_per_zone, *find_field(self))
        return gazebo_rays(name, self, fan, noise=self.filters.values())
