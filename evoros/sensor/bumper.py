"""A bumper: a switch that closes when something touches the robot."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, NamedTuple

import numpy as np

from evoros.base.arrays import Array
from evoros.base.checks import NOT_NEGATIVE, POSITIVE, checked
from evoros.filter.protocol import FILTERS, Filter
from evoros.sensor.gazebo_rays import gazebo_sensor
from evoros.sensor.protocol import BOX, Channel, ContactSensor
from evoros.sensor.signals import TOUCHES

_CONTACT = """\
  <contact>
    <collision>{name}_collision</collision>
  </contact>
"""


@dataclass(frozen=True)
@checked
class Bumper(ContactSensor):
    """A sensor that reads 1 if something has touched its zone since the last reading.

    In top view, the zone is a strip of width ``width_m`` that begins ``depth_m`` behind the mount
    and extends forward. It covers the outline at any height, but not the ground.
    """

    width_m: Annotated[float, POSITIVE] = 0.4  # width of the zone
    depth_m: Annotated[float, NOT_NEGATIVE] = 0.05  # distance from the mount back to its start
    period_s: Annotated[float, POSITIVE] = 0.1  # time between readings
    size_m: Annotated[Sequence[float], BOX] = (0.02, 0.4, 0.05)
    mass_kg: Annotated[float, POSITIVE] = 0.1
    price: Annotated[float, NOT_NEGATIVE] = 3.0
    filters: Annotated[Mapping[str, Filter], FILTERS] = field(default_factory=dict)  # order matters

    @property
    def channels(self) -> tuple[Channel]:
        return (Channel("touch", "", 0.0, 1.0),)

    class Memory(NamedTuple):
        touches: Array  # (1,) number of touches at the last reading

    def start(self) -> tuple[None, Memory]:
        return None, self.Memory(np.zeros(1))

    @staticmethod
    def rule(memory: Memory, signal: Array, values: Array) -> None:
        values[0] = 1.0 if signal[TOUCHES] > memory.touches[0] else 0.0
        memory.touches[0] = signal[TOUCHES]

    def gazebo(self, name: str) -> str:
        """Return the SDF ``<sensor>``, for a collision shape called ``NAME_collision``."""
        return gazebo_sensor(name, "contact", self.period_s, _CONTACT.format(name=name))
