"""The base class of simulators, and the simulations they open."""

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
    """A robot and the initial pose of its base frame: x, y, z [m] and yaw [rad]."""

    robot: "Robot"
    home: tuple[float, float, float, float]


class Simulation(Protocol):
    """Robots in a world, the only mutable object of a mission; arrays hold robot after robot."""

    def observe(self, state: Array) -> None:
        """Fill ``state`` (STATE_SIZE,) with the true state and any contact since the last call."""

    def sense(self, signals: Array) -> None:
        """Fill ``signals`` (n,) of all robots, each in the order of ``Robot.signal_layout``.

        The true range [m] of each beam comes first, within the sensor's limits.
        ``engines.rays.sensor_beams`` lists the beams, one per channel of a range sensor. A beam
        reads its ``clear_range`` without nearer obstacles; ``rays.SteeredParts`` adds steered
        wheels. The signals of all other sensors follow, each with a memory that the simulator must
        not change.
        """

    def advance(self, command: Array, duration: float) -> None:
        """Apply ``command`` (COMMAND_SIZE,) for ``duration`` [s], a multiple of the time step.

        If wheels can fail (``weakens_wheels``), the command is followed by STRENGTH_SIZE values for
        each robot.
        """


class Simulator(ABC):
    """Opens simulations; imports the library of its engine only for the first."""

    time_step: float  # [s]; sensor and controller periods must be multiples of this step
    packages: Sequence[str]  # pip packages that can change results, for the manifest
    versions: Mapping[str, str] = MappingProxyType({})  # non-pip libraries, for the manifest
    measures: Collection[str] = (RANGE,)  # quantities to measure; see ``evoros.sensor.protocol``
    max_robots: int = 1  # maximum number of robots, which can detect and touch each other
    has_walkers: bool = False
    """True if the simulator moves walkers (``evoros.walkers``), which robots detect and touch.

    The walkers are the ``crowd`` of a world. ``observe`` writes REPORT_SIZE values for each walker
    after the states of the robots.
    """
    weakens_wheels: bool = False  # True if its robots' wheels can fail; see ``find_targets``

    @abstractmethod
    def open(
        self, robots: Sequence[PlacedRobot], world: "World"
    ) -> AbstractContextManager[Simulation]:
        """Place robots and bodies; raise SimulationError if the engine cannot simulate them."""

    def check_world(self, world: "World") -> None:  # noqa: B027 - accepts any world
        """Raise an InputError, without the name of the world, if the world cannot be simulated."""

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


# parameters, memory, and the arguments of the method of ``Simulation``
ObserveRule: TypeAlias = Callable[[Array, Array, Array], None]
SenseRule: TypeAlias = Callable[[Array, Array, Array], None]
AdvanceRule: TypeAlias = Callable[[Array, Array, Array, float], None]


class SimulationRules(NamedTuple):
    """The three methods of a simulation as compilable rules."""

    observe: ObserveRule
    sense: SenseRule
    advance: AdvanceRule


@dataclass(frozen=True)
class RuleSimulation:
    """A simulation made of rules, which allows its missions to be compiled."""

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
        """Apply ``command`` for ``duration`` [s]."""
        self.rules.advance(self.parameters, self.memory, command, duration)


class RuleSimulator(Simulator):
    """A simulator that opens ``RuleSimulation`` objects."""

    @abstractmethod
    def choose_rules(self, world: "World", robots: Sequence["Robot"]) -> SimulationRules:
        """Return the rules that simulate robots in a world.

        The choice depends on the world and, of the robots, only on what their sensors measure. Too
        many robots raise an InputError.
        """
