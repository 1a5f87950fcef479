"""What a simulator must offer: simulations of one robot in one world."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, Protocol, TypeAlias, runtime_checkable

from evoros.base.arrays import Array

if TYPE_CHECKING:
    from evoros.robot.model import Robot
    from evoros.world.model import World


class Simulation(Protocol):
    """One robot in one world: the one mutable object of a mission."""

    def observe(self, state: Array) -> None:
        """Fill ``state`` (STATE_SIZE,) with the true state; contact since the last call."""
        ...

    def sense(self, readings: Array) -> None:
        """Fill ``readings`` (n,) with the true range [m] of each sensor, at most its maximum."""
        ...

    def advance(self, command: Array, duration: float) -> None:
        """Drive with ``command`` (COMMAND_SIZE,) for ``duration`` [s], a multiple of the step."""
        ...


@runtime_checkable
class Simulator(Protocol):
    """Opens simulations. The engine's library is imported only when the first one is opened."""

    @property
    def time_step(self) -> float:
        """Physics step [s]; every period of sensors and controllers is a multiple of it."""
        ...

    def open(self, robot: "Robot", world: "World") -> AbstractContextManager[Simulation]:
        """The robot at the world's home, everything else where the world says.

        Raises:
            SimulationError: the engine cannot simulate this robot or world.
        """
        ...


ObserveRule: TypeAlias = Callable[[Array, Array, Array], None]
"""(parameters, memory, state): see ``Simulation.observe``."""

SenseRule: TypeAlias = Callable[[Array, Array, Array], None]
"""(parameters, memory, readings): see ``Simulation.sense``."""

AdvanceRule: TypeAlias = Callable[[Array, Array, Array, float], None]
"""(parameters, memory, command, duration [s]): see ``Simulation.advance``."""


class Motion(NamedTuple):
    """The rules of a simulation that is made of rules, as those of an engine are not."""

    observe: ObserveRule
    sense: SenseRule
    advance: AdvanceRule


@dataclass(frozen=True)
class RuleSimulation:
    """A simulation made of rules, with their parameters and memory; missions in it compile."""

    rules: Motion
    parameters: Array
    memory: Array

    def observe(self, state: Array) -> None:
        """Fill in the true state."""
        self.rules.observe(self.parameters, self.memory, state)

    def sense(self, readings: Array) -> None:
        """Fill in the true ranges."""
        self.rules.sense(self.parameters, self.memory, readings)

    def advance(self, command: Array, duration: float) -> None:
        """Drive."""
        self.rules.advance(self.parameters, self.memory, command, duration)


@runtime_checkable
class RuleSimulator(Protocol):
    """A simulator whose simulations are RuleSimulations."""

    @property
    def rules(self) -> Motion:
        """What all of them run."""
        ...
