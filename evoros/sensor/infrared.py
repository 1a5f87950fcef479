"""A triangulating infrared range finder with a narrow cone and a short range."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from evoros.base import elementary
from evoros.base.arrays import Array
from evoros.base.checks import NOT_NEGATIVE, POSITIVE, checked
from evoros.compilation.elementary_arrays import cos_all, sin_all
from evoros.filter.protocol import FILTERS, Filter
from evoros.sensor.gazebo_rays import Fan, gazebo_rays
from evoros.sensor.protocol import BEAM, BOX, RangeSensor, find_field

RIM = 8  # number of rays on the edge of the cone, besides the central ray


@dataclass(frozen=True)
@checked
class Infrared(RangeSensor):
    """A range sensor with a round cone, sampled by a central ray and eight rays on the edge.

    The defaults, with ``conf/sensor/infrared.yaml``, are close to Sharp's GP2Y0A21. Below its
    minimum range, the real sensor gives meaningless readings; the model reads the minimum.
    """

    radiation = "infrared"  # radiation type in ROS messages
    range_min_m: Annotated[float, NOT_NEGATIVE] = 0.1
    range_max_m: Annotated[float, POSITIVE] = 0.8
    fov_deg: Annotated[float, BEAM] = 5.0  # full width of the cone
    period_s: Annotated[float, POSITIVE] = 0.1  # time between readings
    size_m: Annotated[Sequence[float], BOX] = (0.0135, 0.0295, 0.013)
    mass_kg: Annotated[float, POSITIVE] = 0.0035
    price: Annotated[float, NOT_NEGATIVE] = 8.0
    filters: Annotated[Mapping[str, Filter], FILTERS] = field(default_factory=dict)  # order matters

    def channel_of(self) -> NDArray[np.int64]:
        return np.zeros(1 + RIM, dtype=np.int64)

    def rays(self) -> Array:
        half, turns = math.radians(self.fov_deg) / 2, 2.0 * math.pi * np.arange(RIM) / RIM
        sin, cos = elementary.sin_cos(half)
        rim = np.column_stack((np.full(RIM, cos), sin * cos_all(turns), sin * sin_all(turns)))
        return np.vstack(([1.0, 0.0, 0.0], rim / np.linalg.norm(rim, axis=1, keepdims=True)))

    def gazebo(self, name: str) -> str:
        return gazebo_rays(name, self, Fan(3, *find_field(self)))
