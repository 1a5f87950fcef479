"""The protocol of measures, and the results from which they are computed."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from evoros.base.checks import Rule, is_number, one_of
from evoros.base.errors import InputError
from evoros.design.design import Design
from evoros.mission.outcome import Outcomes
from evoros.robot.model import Robot

OBJECTIVES, DESCRIPTORS = "objectives", "descriptors"
"""The keys of an experiment's measures, with which columns of tables begin."""
MAXIMIZE, MINIMIZE = "maximize", "minimize"
DIRECTION = one_of(MAXIMIZE, MINIMIZE)
BOUNDS = Rule(
    "a list of two numbers, the lower one first",
    lambda v: (
        isinstance(v, list | tuple) and len(v) == 2 and all(map(is_number, v)) and v[0] < v[1]
    ),
)


@dataclass(frozen=True)
class Evaluated:
    """A design and the results of its missions."""

    design: Design
    robots: Mapping[str, Robot]
    """Robots with their own design, by name ("" for the configuration's top level), with their
    sensors and evolved values."""
    trials: Sequence[Sequence[Outcomes]]  # for each trial the outcomes of the robots in each world
    fitness: float
    score: Callable[[Sequence[Outcomes]], float]  # by the experiment's fitness

    def robot(self, name: str) -> Robot:
        """Return the robot of a name; raise an InputError if there is none."""
        if name not in self.robots:
            known = ", ".join(map(repr, self.robots))
            raise InputError(
                f"robot: must be the name of a robot with a design of its own ({known}), not "
                f"{name!r}; choose one of these"
            )
        return self.robots[name]


@runtime_checkable
class Measure(Protocol):
    """One number of a design, an objective or a descriptor."""

    @property
    def title(self) -> str:
        """Its name on the axes of figures."""

    @property
    def unit(self) -> str:
        """Its unit; empty if it has none."""

    @property
    def bounds(self) -> Sequence[float]:
        """The minimum and maximum that are told apart; designs may lie beyond."""

    @property
    def direction(self) -> str:
        """Whether an objective is to ``maximize`` or to ``minimize``."""

    @property
    def of_design(self) -> bool:
        """Whether it depends on the design alone, so that it can be tried before a run."""

    def compute(self, evaluated: Evaluated) -> float:
        """Return the number, which must be finite."""
