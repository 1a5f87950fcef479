"""A bumper: a switch that closes where something touches the robot."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, ClassVar, NamedTuple

import numpy as np

from evoros.base.arrays import Array
from evoros.base.checks import NOT_NEGATIVE, POSITIVE, checked
from evoros.filter.protocol import FILTERS, Filter
from evoros.sensor.gazebo_rays import gazebo_sensor
from evoros.sensor.protocol import BOX, CONTACT, Channel
from evoros.sensor.signals import TOUCHES

_CONTACT = """\
  <contact>
    <collision>{name}_collision</collision>
  </contact>
"""


@dataclass(frozen=True)
@checked
class Bumper:
    """Reads 1 if something has touched the robot in its zone since its last reading, else 0.

    Seen from above, the zone is a strip along the direction in which the bumper faces, ``width_m``
    wide, that begins ``depth_m`` behind its mount. So it covers that part of the outline of the
    robot which lies around the mount and before it, at any height. The ground touches nothing.
    """

    measures: ClassVar[str] = CONTACT
    width_m: Annotated[float, POSITIVE] = 0.4  # of the zone, from its left to its right edge
    depth_m: Annotated[float, NOT_NEGATIVE] = 0.05  # how far behind the mount the zone begins
    period_s: Annotated[float, POSITIVE] = 0.1  # time between two readings
    size_m: Annotated[Sequence[float], BOX] = (0.02, 0.4, 0.05)
    mass_kg: Annotated[float, POSITIVE] = 0.1
    price: Annotated[float, NOT_NEGATIVE] = 3.0
    filters: Annotated[Mapping[str, Filter], FILTERS] = field(default_factory=dict)  # in order

    @property
    def channels(self) -> tuple[Channel]:
        """Whether something touches it."""
        return (Channel("touch", "", 0.0, 1.0),)

    class Memory(NamedTuple):
        touches: Array  # (1,) at the last reading

    def start(self) -> tuple[None, Memory]:
        """Begin without a touch."""
        return None, self.Memory(np.zeros(1))

    @staticmethod
    def rule(memory: Memory, signal: Array, values: Array) -> None:
        """Compare the number of touches with that at the last reading."""
        values[0] = 1.0 if signal[TOUCHES] > memory.touches[0] else 0.0
        memory.touches[0] = signal[TOUCHES]

    def gazebo(self, name: str) -> str:
        """The SDF ``<sensor>`` called ``name``, which is its topic too.

        Gazebo needs a collision shape of that name, which evoros does not write.
        """
        return gazebo_sensor(name, "contact", self.period_s, _CONTACT.format(name=name))
