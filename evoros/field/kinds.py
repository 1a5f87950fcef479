"""Kinds of obstacles in a generated field."""

from dataclasses import dataclass
from typing import Annotated, Protocol, runtime_checkable

from numpy.random import Generator

from evoros.base.checks import POSITIVE, Rule, checked, mapping_of
from evoros.base.intervals import INTERVAL, Interval, bounds, scale
from evoros.geometry.shapes import MASS, Shape

MIN_SIZE_M = 0.001
"""Sizes are rounded to multiples of it."""

SIZE = Rule(
    f"a number of at least {MIN_SIZE_M:g}, or [low, high] of such numbers with low at most high",
    lambda v: INTERVAL.holds(v) and bounds(v)[0] >= MIN_SIZE_M,
)


@runtime_checkable
class ObstacleKind(Protocol):
    """A kind of obstacle, from which single obstacles are drawn.

    The SDF of a generated field names it by its class, in lower case, with its fields.
    """

    @property
    def share(self) -> float:
        """The frequency of this kind, in proportion to the shares of the other kinds."""

    @property
    def mass_kg(self) -> float | None:
        """The mass of an obstacle that can be pushed; None: it is fixed."""

    def draw(self, rng: Generator) -> Shape:
        """Draw the shape of an obstacle: a box or cylinder with sizes in whole millimetres."""


KINDS = mapping_of(ObstacleKind, "kinds of obstacles (share, mass_kg and draw)")


@dataclass(frozen=True)
@checked
class Box:
    """An upright box, such as a crate, a low block or a wall."""

    length_m: Annotated[Interval, SIZE]
    width_m: Annotated[Interval, SIZE]
    height_m: Annotated[Interval, SIZE]
    share: Annotated[float, POSITIVE] = 1.0
    mass_kg: Annotated[float | None, MASS] = None

    def draw(self, rng: Generator) -> Shape:
        """Draw the length along x, the width along y and the height along z."""
        intervals = (self.length_m, self.width_m, self.height_m)
        return Shape("box", tuple(_draw_size(interval, rng) for interval in intervals))


@dataclass(frozen=True)
@checked
class Cylinder:
    """An upright cylinder, such as a post, a trunk or a barrel."""

    diameter_m: Annotated[Interval, SIZE]
    height_m: Annotated[Interval, SIZE]
    share: Annotated[float, POSITIVE] = 1.0
    mass_kg: Annotated[float | None, MASS] = None

    def draw(self, rng: Generator) -> Shape:
        """Draw the diameter and the height."""
        diameter, height = (_draw_size(size, rng) for size in (self.diameter_m, self.height_m))
        return Shape("cylinder", (diameter / 2, height))


def _draw_size(interval: Interval, rng: Generator) -> float:
    return round(scale(float(rng.random()), *bounds(interval)), 3)
