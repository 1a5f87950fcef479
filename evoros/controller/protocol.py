"""What a controller and its layers must offer."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from typing import NamedTuple, Protocol, TypeAlias, runtime_checkable

from numpy.random import Generator

from evoros.base.arrays import Array, RuleArrays
from evoros.base.checks import instance_of
from evoros.filter.protocol import Filter
from evoros.robot.model import Robot

LayerRule: TypeAlias = Callable[[Array, Array, Array, Array, Array, float, Array], bool]
"""(parameters, memory, state, leg, readings [m], time [s], command) -> took the decision?

``state`` is as localized; the rule fills ``command`` only if it returns True.
"""


@runtime_checkable
class Layer(Protocol):
    """One behaviour of a controller. The first layer that takes the decision preempts the rest."""

    @property
    def mode(self) -> str:
        """What the robot does while this layer decides: ``avoiding``, ``navigating`` ...

        The share of the decisions in the mode ``avoiding`` is a column of ``missions.csv``.
        """
        ...

    @property
    def rule(self) -> LayerRule:
        """Decide; a static method, so that numba can compile it."""
        ...

    def start(self, robot: Robot, period: float, rng: Generator) -> RuleArrays:
        """Return the parameters and the memory of ``rule`` for one mission.

        ``period`` is the controller's [s].
        """
        ...


class StartedLayer(NamedTuple):
    """A layer in a mission: its rule with its own parameters and memory."""

    rule: LayerRule
    parameters: Array
    memory: Array


@runtime_checkable
class Controller(Protocol):
    """Turns readings and the localized pose into commands, at its own period.

    ``open`` may acquire resources (a process, a socket); leaving the context releases them. An
    external controller offers one layer whose rule is a method of the live object.
    """

    @property
    def period_s(self) -> float:
        """Time between two decisions."""
        ...

    @property
    def localization(self) -> Mapping[str, Filter]:
        """The filters, by name, that act in order on the pose before the layers see it."""
        ...

    @property
    def modes(self) -> Sequence[str]:
        """The mode of each layer that ``open`` gives, in the same order."""
        ...

    def open(
        self, robot: Robot, rng: Callable[[str], Generator]
    ) -> AbstractContextManager[Sequence[StartedLayer]]:
        """Start the layers for one mission.

        ``rng(name)`` returns the generator of the named part for this mission.
        """
        ...


A_CONTROLLER = instance_of(Controller, "a controller (period_s, localization, modes and open)")
