"""What a controller and its layers must offer."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, TypeAlias, runtime_checkable

from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import instance_of
from evoros.filter.protocol import Filter

if TYPE_CHECKING:
    from evoros.robot.model import Robot

LayerRule: TypeAlias = Callable[[Array, Array, Array, Array, Array, float, Array], bool]
"""(parameters, memory, state, leg, readings [m], time [s], command) -> took the decision?

``state`` is as localized; the rule fills ``command`` only where it returns True.
"""


@runtime_checkable
class Layer(Protocol):
    """One behaviour of a controller. The first layer that takes the decision preempts the rest."""

    @property
    def mode(self) -> str:
        """What the robot does while this layer decides: ``avoiding``, ``navigating`` ..."""
        ...

    @property
    def rule(self) -> LayerRule:
        """How it decides."""
        ...

    def start(self, robot: "Robot", period: float, rng: Generator) -> tuple[Array, Array]:
        """Parameters and memory for one mission; ``period`` is the controller's [s]."""
        ...


@dataclass(frozen=True)
class StartedLayer:
    """A layer in a mission: its rule with its own parameters and memory."""

    mode: str
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
        """By name, applied in order to the pose (x, y, yaw, speed) before the layers see it."""
        ...

    def open(
        self, robot: "Robot", rng: Callable[[str], Generator]
    ) -> AbstractContextManager[Sequence[StartedLayer]]:
        """``rng(name)`` gives the named part's own generator for this mission."""
        ...


A_CONTROLLER = instance_of(Controller, "a controller (period_s, localization and open)")
