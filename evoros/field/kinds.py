"""Kinds of obstacles that a generated field is made of."""

from dataclasses import dataclass
from typing import Annotated, Protocol, runtime_checkable

from numpy.random import Generator

from evoros.base.checks import POSITIVE, Rule, checked, is_number, mapping_of
from evoros.base.intervals import INTERVAL, Interval, bounds, scale
from evoros.geometry.shapes import Shape

LEAST_M = 0.001  # to which sizes are rounded

SIZE = Rule(
    f"a number of at least {LEAST_M:g}, or [low, high] of such numbers with low at most high",
    lambda v: INTERVAL.holds(v) and bounds(v)[0] >= LEAST_M,
)
MASS = Rule("a number greater than 0, or null", lambda v: v is None or (is_number(v) and v > 0))


@runtime_checkable
class Kind(Protocol):
    """What one obstacle of this kind may be."""

    @property
    def share(self) -> float:
        """How often, in proportion to the shares of the other kinds."""
        ...

    @property
    def mass_kg(self) -> float | None:
        """Mass of an obstacle that can be pushed; None: it is fixed."""
        ...

    def draw(self, rng: Generator) -> Shape:
        """An obstacle's shape, a box or a cylinder, its sizes rounded to millimetres."""
        ...


KINDS = mapping_of(Kind, "kinds of obstacles (share, mass_kg and draw)")


@dataclass(frozen=True)
@checked
class Box:
    """An upright box: a crate, a low block, a wall."""

    length_m: Annotated[Interval, SIZE]
    width_m: Annotated[Interval, SIZE]
    height_m: Annotated[Interval, SIZE]
    share: Annotated[float, POSITIVE] = 1.0
    mass_kg: Annotated[float | None, MASS] = None

    def draw(self, rng: Generator) -> Shape:
        """Length along x, width along y, height along z."""
        sizes = (_drawn(each, rng) for each in (self.length_m, self.width_m, self.height_m))
        return Shape("box", tuple(sizes))


@dataclass(frozen=True)
@checked
class Cylinder:
    """An upright cylinder: a post, a trunk, a barrel."""

    diameter_m: Annotated[Interval, SIZE]
    height_m: Annotated[Interval, SIZE]
    share: Annotated[float, POSITIVE] = 1.0
    mass_kg: Annotated[float | None, MASS] = None

    def draw(self, rng: Generator) -> Shape:
        """Radius and height."""
        diameter, height = (_drawn(each, rng) for each in (self.diameter_m, self.height_m))
        return Shape("cylinder", (diameter / 2, height))


def _drawn(interval: Interval, rng: Generator) -> float:
    return round(scale(float(rng.random()), *bounds(interval)), 3)
