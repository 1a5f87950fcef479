"""The base class of measures, and the data from which measures are computed."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from evoros.base.checks import Rule, is_number, one_of
from evoros.base.errors import InputError
from evoros.design.design import Design
from evoros.mission.mission import Outcomes
from evoros.robot.model import Robot

OBJECTIVES, DESCRIPTORS = "objectives", "descriptors"  # keys, and prefixes of columns in tables
MAXIMIZE, MINIMIZE = "maximize", "minimize"
DIRECTION = one_of(MAXIMIZE, MINIMIZE)
BOUNDS = Rule(
    "a list of two numbers, the lower number first",
    lambda v: (
        isinstance(v, list | tuple) and len(v) == 2 and all(map(is_number, v)) and v[0] < v[1]
    ),
)


@dataclass(frozen=True)
class Evaluated:
    """A design and the results of its missions."""

    design: Design
    robots: Mapping[str, Robot]  # robots with separate designs, by name; "" is the first robot
    trials: Sequence[Sequence[Outcomes]]  # outcomes in each world, trial by trial
    fitness: float
    score: Callable[[Sequence[Outcomes]], float]  # scores a trial by the fitness function

    def robot(self, name: str) -> Robot:
        """Return a robot by name; raise an InputError if the name is unknown."""
        if name not in self.robots:
            known = ", ".join(map(repr, self.robots))
            raise InputError(
                f"robot: must be the name of a robot with a separate design ({known}), not {name!r}"
            )
        return self.robots[name]


class Measure(ABC):
    """A number that describes a design, for use as an objective or a descriptor."""

    title: str  # name in figures
    unit: str = ""  # unit in figures; empty if dimensionless
    bounds: Sequence[float]  # minimum and maximum in an archive; designs may lie outside
    direction: str = MAXIMIZE  # direction of optimization, ``maximize`` or ``minimize``
    of_design: bool = False  # True if the value needs no outcomes and is checked before a run

    @abstractmethod
    def compute(self, evaluated: Evaluated) -> float:
        """Return the value, which must be finite."""
