"""A sonar: one range, the nearest hit of a grid of rays that fills its beam."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray

from evoros.base.arrays import Array
from evoros.base.checks import COUNT, NOT_NEGATIVE, POSITIVE, checked
from evoros.compilation.elementary_arrays import cos_all, sin_all
from evoros.filter.protocol import FILTERS, Filter
from evoros.sensor.gazebo_rays import Fan, gazebo_rays
from evoros.sensor.protocol import BEAM, BOX, RANGE, Channel, check_limits


@dataclass(frozen=True)
@checked
class Sonar:
    """A range sensor with a square beam, sampled by ``rays_per_axis`` squared rays.

    The defaults, with ``conf/sensor/sonar.yaml``, are the sonar of the 2018 paper (Evo-ROS).
    """

    measures: ClassVar[str] = RANGE
    range_min_m: Annotated[float, NOT_NEGATIVE] = 0.06
    range_max_m: Annotated[float, POSITIVE] = 4.5
    fov_deg: Annotated[float, BEAM] = 30.0  # full width of the beam, horizontal and vertical alike
    rays_per_axis: Annotated[int, replace(COUNT, limit=100)] = 5
    period_s: Annotated[float, POSITIVE] = 0.1  # time between two readings
    size_m: Annotated[Sequence[float], BOX] = (0.02, 0.045, 0.02)  # of common small sonars
    mass_kg: Annotated[float, POSITIVE] = 0.009
    price: Annotated[float, NOT_NEGATIVE] = 4.0
    filters: Annotated[Mapping[str, Filter], FILTERS] = field(default_factory=dict)  # in order

    def __post_init__(self) -> None:
        check_limits(self)

    @property
    def channels(self) -> tuple[Channel]:
        """The range alone."""
        return (Channel("range", "m", self.range_min_m, self.range_max_m),)

    def channel_of(self) -> NDArray[np.int64]:
        """Return the only channel for all rays."""
        return np.zeros(self.rays_per_axis**2, dtype=np.int64)

    def rays(self) -> Array:
        """(rays_per_axis squared, 3) unit vectors in the sensor's frame: x forward, z up.

        ``(cos a cos b, sin a cos b, sin b)`` for azimuth a (left positive) and elevation b, both
        evenly spaced over the beam, its edges included; a single ray points forward.
        """
        # Not linspace: its left and right rays are not mirror images to the last bit.
        spaces = self.rays_per_axis - 1
        half_space = math.radians(self.fov_deg) / 2 / max(spaces, 1)
        angles = np.arange(-spaces, spaces + 1, 2) * half_space
        a, b = (grid.ravel() for grid in np.meshgrid(angles, angles, indexing="ij"))
        return np.column_stack((cos_all(a) * cos_all(b), sin_all(a) * cos_all(b), sin_all(b)))

    def gazebo(self, name: str) -> str:
        """The SDF ``<sensor>`` called ``name``, which is its topic too.

        Gazebo publishes all rays, of which the reader takes the minimum. Of the filters, Gazebo
        itself knows Gaussian noise only.
        """
        edge = math.radians(self.fov_deg) / 2 if self.rays_per_axis > 1 else 0.0
        fan = Fan(self.rays_per_axis, -edge, edge)
        return gazebo_rays(name, self, fan, fan, self.filters.values())
