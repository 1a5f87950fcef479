"""Simulations that are made of rules, as filters and layers are: missions in them compile."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol, TypeAlias, runtime_checkable

from evoros.types import Array

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
