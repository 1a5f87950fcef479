"""A sonar, whose range is the nearest hit of a grid of rays across the beam."""

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
class Sonar(RangeSensor):
    """A range sensor with a square beam, sampled by a square grid of rays.

    Objects between rays are missed (preflight warns). Defaults match the 2018 paper (Evo-ROS).
    """

    range_min_m: Annotated[float, NOT_NEGATIVE] = 0.06
    range_max_m: Annotated[float, POSITIVE] = 4.5
    fov_deg: Annotated[float, BEAM] = 30.0  # full width of the beam, horizontally and vertically
    rays_per_axis: Annotated[int, replace(COUNT, limit=100)] = 5
    period_s: Annotated[float, POSITIVE] = 0.1  # time between readings
    size_m: Annotated[Sequence[float], BOX] = (0.02, 0.045, 0.02)  # typical size of small sonars
    mass_kg: Annotated[float, POSITIVE] = 0.009
    price: Annotated[float, NOT_NEGATIVE] = 4.0
    filters: Annotated[Mapping[str, Filter], FILTERS] = field(default_factory=dict)  # order matters

    def channel_of(self) -> NDArray[np.int64]:
        return np.zeros(self.rays_per_axis**2, dtype=np.int64)

    def rays(self) -> Array:
        """Return (cos a cos b, sin a cos b, sin b) for azimuths a (left) and elevations b."""
        spaces = max(self.rays_per_axis - 1, 1)
        angles = spread_bearings(self.rays_per_axis, self.fov_deg, spaces)
        a, b = (grid.ravel() for grid in np.meshgrid(angles, angles, indexing="ij"))
        return np.column_stack((cos_all(a) * cos_all(b), sin_all(a) * cos_all(b), sin_all(b)))

    def gazebo(self, name: str) -> str:
        fan = Fan(self.rays_per_axis, *find_field(self))
        return gazebo_rays(name, self, fan, fan, self.filters.values())
