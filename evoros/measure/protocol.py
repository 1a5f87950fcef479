"""The base class of measures, and the results that they use."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from evoros.base.checks import Rule, is_number, one_of
from evoros.base.errors import InputError
from evoros.design.design import Design
from evoros.mission.mission import Outcomes
from evoros.robot.model import Robot

OBJECTIVES, DESCRIPTORS = "objectives", "descriptors"
"""Keys of an experiment's measures, and prefixes of their table columns."""
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
    robots: Mapping[str, Robot]
    """Robots with separate designs, equipped and keyed by name; "" is the first robot."""
    trials: Sequence[Sequence[Outcomes]]  # outcomes of the robots in each world, trial by trial
    fitness: float
    # scores a trial with the experiment's fitness function
    score: Callable[[Sequence[Outcomes]], float]

    def robot(self, name: str) -> Robot:
        """Return a robot by name; raise an InputError if there is no such robot."""
        if name not in self.robots:
            known = ", ".join(map(repr, self.robots))
            raise InputError(
                f"robot: must be the name of a robot with a separate design ({known}), not {name!r}"
            )
        return self.robots[name]


class Measure(ABC):
    """A number that describes a design, as an objective or a descriptor."""

    title: str  # measure's name on the axes of figures
    unit: str = ""  # measure's unit; empty if dimensionless
    bounds: Sequence[float]
    """The minimum and maximum that an archive distinguishes; designs may lie outside."""
    direction: str = MAXIMIZE
    """The direction of optimization of an objective, ``maximize`` or ``minimize``."""
    of_design: bool = False
    """True if the measure depends only on the design, so it can be checked before a run."""

    @abstractmethod
    def compute(self, evaluated: Evaluated) -> float:
        """Return the value, which must be finite."""
