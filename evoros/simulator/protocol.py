"""The base class of simulators, which open simulations of robots in a world."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple, Protocol, TypeAlias, TypeVar

from evoros.base.arrays import Array
from evoros.base.checks import Rule
from evoros.sensor.protocol import RANGE

if TYPE_CHECKING:
    from evoros.drive.protocol import Drive
    from evoros.robot.model import Robot
    from evoros.world.model import World

Opened = TypeVar("Opened", bound="Simulation")


class PlacedRobot(NamedTuple):
    """A robot, and the pose of its base frame at the start: x, y, z [m] and yaw [rad]."""

    robot: "Robot"
    home: tuple[float, float, float, float]


class Simulation(Protocol):
    """Robots in a world, a mission's only mutable object; arrays hold one robot after another."""

    def observe(self, state: Array) -> None:
        """Fill ``state`` (STATE_SIZE,) with the true state and any contact since the last call."""

    def sense(self, signals: Array) -> None:
        """Fill ``signals`` (n,) of all robots, each laid out as in ``Robot.signal_layout``.

        The true range [m] of each beam comes first, within the sensor's limits.
        ``engines.rays.sensor_beams`` lists the beams, one per channel of a range sensor. A beam
        reads its ``clear_range`` if no obstacle is nearer; ``rays.SteeredParts`` accounts for
        steered wheels. The signals of all other sensors follow, each followed by a memory that the
        simulator must not change.
        """

    def advance(self, command: Array, duration: float) -> None:
        """Drive with ``command`` (COMMAND_SIZE,) for ``duration`` [s], a multiple of the time step.

        If wheels can fail (``weakens_wheels``), the command is followed by STRENGTH_SIZE values for
        each robot.
        """


class Simulator(ABC):
    """A factory of simulations; it imports the engine's library only to open the first."""

    time_step: float  # physics step [s]; all sensor and controller periods are multiples of it
    packages: Sequence[str]
    """pip names of the packages whose versions can change results, such as the engine's.

    A run's manifest records their versions.
    """
    versions: Mapping[str, str] = MappingProxyType({})
    """Versions of libraries that pip does not know, by name, for the manifest."""
    measures: Collection[str] = (RANGE,)
    """The quantities that the simulator provides; see ``evoros.sensor.protocol``."""
    max_robots: int = 1
    """Maximum number of robots in a world; robots can sense and touch each other."""
    has_walkers: bool = False
    """True if the simulator moves walkers (``evoros.walkers``), which robots can sense and touch.

    The walkers are the ``crowd`` of a world. ``observe`` writes REPORT_SIZE values for each walker
    after the states of the robots.
    """
    weakens_wheels: bool = False
    """True if the simulator models weakened wheels; otherwise missions reject wheel failures.

    ``evoros.drive.protocol.find_targets`` computes the wheel rates.
    """

    @abstractmethod
    def open(
        self, robots: Sequence[PlacedRobot], world: "World"
    ) -> AbstractContextManager[Simulation]:
        """Place robots and bodies; raise a SimulationError if the engine cannot simulate them."""

    def check_world(self, world: "World") -> None:  # noqa: B027 - accepts any world
        """Raise an InputError, without the world's name, for a world that cannot be simulated."""

    def doubt_drive(self, drive: "Drive") -> str:
        """Return why the engine is inaccurate for a drive at any time step, or ""."""
        return ""


def open_alone(
    opener: "Callable[[Sequence[PlacedRobot], World], AbstractContextManager[Opened]]",
    robot: "Robot",
    world: "World",
) -> AbstractContextManager[Opened]:
    """Open a simulation of one robot at its home pose; ``opener`` is a simulator's ``open``."""
    return opener([PlacedRobot(robot, world.course.home)], world)


A_SIMULATOR = Rule(
    "an evoros.parts.Simulator (with time_step, packages and open)",
    lambda v: isinstance(v, Simulator) and hasattr(v, "time_step") and hasattr(v, "packages"),
)


# Parameters, memory, and the arguments of the method of ``Simulation``.
ObserveRule: TypeAlias = Callable[[Array, Array, Array], None]
SenseRule: TypeAlias = Callable[[Array, Array, Array], None]
AdvanceRule: TypeAlias = Callable[[Array, Array, Array, float], None]


class SimulationRules(NamedTuple):
    """The three methods of a simulation as rules that can be compiled."""

    observe: ObserveRule
    sense: SenseRule
    advance: AdvanceRule


@dataclass(frozen=True)
class RuleSimulation:
    """A simulation made of rules, so that its missions can be compiled."""

    rules: SimulationRules
    parameters: Array
    memory: Array

    def observe(self, state: Array) -> None:
        """Fill ``state`` with the true state."""
        self.rules.observe(self.parameters, self.memory, state)

    def sense(self, signals: Array) -> None:
        """Fill ``signals`` with the true ranges [m] and the signals of sensors without rays."""
        self.rules.sense(self.parameters, self.memory, signals)

    def advance(self, command: Array, duration: float) -> None:
        """Drive with ``command`` for ``duration`` [s]."""
        self.rules.advance(self.parameters, self.memory, command, duration)


class RuleSimulator(Simulator):
    """A simulator whose simulations are ``RuleSimulation``s."""

    @abstractmethod
    def choose_rules(self, world: "World", robots: Sequence["Robot"]) -> SimulationRules:
        """Return the rules that simulate robots in a world.

        The choice depends on the world and, of the robots, only on what their sensors measure.

        Raises:
            InputError: the simulator cannot simulate this number of robots.
        """
