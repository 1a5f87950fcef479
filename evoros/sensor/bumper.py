"""A bumper: a switch that closes where something touches the robot."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, ClassVar

from numpy.random import Generator

from evoros.base.arrays import NO_PARAMETERS, Array
from evoros.base.checks import NOT_NEGATIVE, POSITIVE, checked
from evoros.filter.protocol import FILTERS, Filter
from evoros.sensor.protocol import BOX, CONTACT, SIGNAL_SIZES, Channel
from evoros.sensor.signals import TOUCHES

_SENSOR = """\
<sensor name="{name}" type="contact">
  <topic>{name}</topic>
  <update_rate>{rate}</update_rate>
  <always_on>true</always_on>
  <contact>
    <collision>{name}_collision</collision>
  </contact>
</sensor>
"""
_COUNTED = SIGNAL_SIZES[CONTACT]


@dataclass(frozen=True)
@checked
class Bumper:
    """Reads 1 if something has touched the robot in its zone since its last reading, else 0.

    Seen from above, the zone is a strip along the direction in which the bumper faces, ``width_m``
    wide, that begins ``depth_m`` behind its mount. So it covers that part of the outline of the
    robot which lies around the mount and before it, at any height. The ground touches nothing.
    """

    measures: ClassVar[str] = CONTACT
    memory_size: ClassVar[int] = 1
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

    def parameters(self) -> Array:
        """Return none."""
        return NO_PARAMETERS

    @staticmethod
    def rule(parameters: Array, memory: Array, rng: Generator, values: Array, time: float) -> None:
        """Compare the number of touches with that at the last reading."""
        values[0] = 1.0 if memory[TOUCHES] > memory[_COUNTED] else 0.0
        memory[_COUNTED] = memory[TOUCHES]

    def gazebo(self, name: str) -> str:
        """The SDF ``<sensor>`` called ``name``, which is its topic too.

        Gazebo needs a collision shape of that name, which evoros does not write.
        """
        return _SENSOR.format(name=name, rate=1 / self.period_s)
