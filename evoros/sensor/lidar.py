"""A planar lidar, with one range per direction in a plane."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from evoros.base.arrays import Array
from evoros.base.checks import COUNT, NOT_NEGATIVE, POSITIVE, Rule, checked, is_number
from evoros.compilation.elementary_arrays import cos_all, sin_all
from evoros.filter.protocol import FILTERS, Filter
from evoros.sensor.gazebo_rays import Fan, gazebo_rays
from evoros.sensor.protocol import BOX, RangeSensor, spread_bearings

FIELD = Rule("an angle greater than 0 and at most 360", lambda v: is_number(v) and 0 < v <= 360)


@dataclass(frozen=True)
@checked
class Lidar(RangeSensor):
    """A range sensor with ``beams`` evenly spaced rays in its x-y plane.

    Rays are ordered from right to left and include both edges, unless the field of view is 360 deg.
    The defaults match small scanners of indoor robots.
    """

    range_min_m: Annotated[float, NOT_NEGATIVE] = 0.15
    range_max_m: Annotated[float, POSITIVE] = 8.0
    fov_deg: Annotated[float, FIELD] = 360.0  # full width, centred on the sensor's x axis
    beams: Annotated[int, replace(COUNT, limit=100_000)] = 360
    period_s: Annotated[float, POSITIVE] = 0.1  # time between scans
    size_m: Annotated[Sequence[float], BOX] = (0.07, 0.07, 0.04)
    mass_kg: Annotated[float, POSITIVE] = 0.17
    price: Annotated[float, NOT_NEGATIVE] = 99.0
    filters: Annotated[Mapping[str, Filter], FILTERS] = field(default_factory=dict)  # order matters

    def channel_of(self) -> NDArray[np.int64]:
        return np.arange(self.beams)

    def rays(self) -> Array:
        angles = self._angles()
        return np.column_stack((cos_all(angles), sin_all(angles), np.zeros(self.beams)))

    def _angles(self) -> Array:
        spaces = self.beams if self.fov_deg == 360.0 else max(self.beams - 1, 1)
        return spread_bearings(self.beams, self.fov_deg, spaces)

    def gazebo(self, name: str) -> str:
        angles = self._angles()
        fan = Fan(self.beams, angles[0], angles[-1])
        return gazebo_rays(name, self, fan, noise=self.filters.values())
