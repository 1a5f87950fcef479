"""The protocols of simulators: each opens simulations of robots in a world."""

from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, Protocol, TypeAlias, TypeVar, runtime_checkable

from evoros.base.arrays import Array
from evoros.base.checks import instance_of
from evoros.sensor.protocol import RANGE

if TYPE_CHECKING:
    from evoros.drive.protocol import Drive
    from evoros.robot.model import Robot
    from evoros.world.model import World

Opened = TypeVar("Opened", bound="Simulation")


class PlacedRobot(NamedTuple):
    """A robot, and where it starts: x, y, z [m] and yaw [rad] of its base frame."""

    robot: "Robot"
    home: tuple[float, float, float, float]


class Simulation(Protocol):
    """Robots in a world. Of all that a mission uses, this alone is mutable.

    Its arrays have the parts of the robots one after another, in their order.
    """

    def observe(self, state: Array) -> None:
        """Fill ``state`` (STATE_SIZE,) with the true state; its contact is that since last time."""
        ...

    def sense(self, signals: Array) -> None:
        """Fill ``signals`` (n,): each robot's in the parts of ``Robot.signal_layout``.

        First comes the true range [m] of each beam, within the sensor's limits.
        ``engines.rays.sensor_beams`` lists the beams: one for each channel of a range sensor. A
        beam reads its ``clear_range`` if no obstacle is nearer, and ``steered_sight.SteeredParts``
        adds steered wheels. Then come the signals of all other sensors, each before a memory that
        is not the simulator's.
        """
        ...

    def advance(self, command: Array, duration: float) -> None:
        """Drive with ``command`` (COMMAND_SIZE,) for ``duration`` [s], a multiple of the step.

        The STRENGTH_SIZE values of each robot follow if wheels can fail (``WheelSimulator``).
        """
        ...


@runtime_checkable
class Simulator(Protocol):
    """Opens simulations. It imports the library of its engine only when it opens the first one."""

    @property
    def time_step(self) -> float:
        """Physics step [s]; the periods of all sensors and controllers are multiples of it."""
        ...

    @property
    def packages(self) -> Sequence[str]:
        """The installed packages whose versions can change missions, for example its engine's.

        They are the names that pip uses. The manifest of a run records their versions.
        """
        ...

    def open(
        self, robots: Sequence[PlacedRobot], world: "World"
    ) -> AbstractContextManager[Simulation]:
        """Place the robots, and the bodies where the world puts them.

        There is one robot, unless the simulator is a ``TeamSimulator``.

        Raises:
            SimulationError: the engine cannot simulate these robots or this world.
        """
        ...


@runtime_checkable
class VersionedSimulator(Protocol):
    """A simulator whose missions depend on libraries that pip does not know."""

    @property
    def versions(self) -> Mapping[str, str]:
        """Their versions by name, which the manifest of a run records among the programs'."""
        ...


@runtime_checkable
class SignallingSimulator(Protocol):
    """A simulator that serves other sensors too, besides those that measure ranges."""

    @property
    def measures(self) -> Collection[str]:
        """All that its sensors can measure, see ``evoros.sensor.protocol``."""
        ...


def measured_by(simulator: Simulator) -> Collection[str]:
    """Return all that the sensors of a simulator can measure."""
    return simulator.measures if isinstance(simulator, SignallingSimulator) else (RANGE,)


@runtime_checkable
class SelectiveSimulator(Protocol):
    """A simulator that cannot simulate every world; others need no ``check_world``."""

    def check_world(self, world: "World") -> None:
        """Refuse a world before any mission starts.

        Raises:
            InputError: the simulator cannot simulate the world; the message does not name it.
        """
        ...


@runtime_checkable
class DoubtfulSimulator(Protocol):
    """A simulator that cannot move every drive right; others need no ``doubt_drive``."""

    def doubt_drive(self, drive: "Drive") -> str:
        """Return why no step makes the engine right for a drive; an empty text if one may."""
        ...


def doubt_drive(simulator: Simulator, drive: "Drive") -> str:
    """Return why a simulator cannot move a drive right; an empty text if it may."""
    return simulator.doubt_drive(drive) if isinstance(simulator, DoubtfulSimulator) else ""


@runtime_checkable
class TeamSimulator(Protocol):
    """A simulator of robots that sense and touch one another; others simulate one robot."""

    @property
    def max_robots(self) -> int:
        """How many robots can share a world."""
        ...


def count_possible(simulator: Simulator) -> int:
    """Return how many robots a simulator can simulate together."""
    return simulator.max_robots if isinstance(simulator, TeamSimulator) else 1


@runtime_checkable
class WalkerSimulator(Protocol):
    """A simulator that moves walkers (``evoros.walkers``); others take worlds without any.

    Its robots sense and touch the ``crowd`` of a world. ``observe`` writes REPORT_SIZE values for
    each walker after the states of the robots.
    """

    @property
    def has_walkers(self) -> bool:
        """Whether it moves them."""
        ...


def has_walkers(simulator: Simulator) -> bool:
    """Whether a simulator moves walkers."""
    return isinstance(simulator, WalkerSimulator) and simulator.has_walkers


@runtime_checkable
class WheelSimulator(Protocol):
    """A simulator whose robots can have weak wheels; others refuse failures of wheels.

    ``evoros.drive.weak_wheels.find_targets`` has the rates of their wheels.
    """

    @property
    def weakens_wheels(self) -> bool:
        """Whether it does."""
        ...


def weakens_wheels(simulator: Simulator) -> bool:
    """Whether the wheels of a simulator's robots can be weak."""
    return isinstance(simulator, WheelSimulator) and simulator.weakens_wheels


def open_alone(
    opener: "Callable[[Sequence[PlacedRobot], World], AbstractContextManager[Opened]]",
    robot: "Robot",
    world: "World",
) -> AbstractContextManager[Opened]:
    """Open a simulation of one robot at the home of a world; ``opener`` is a simulator's method."""
    return opener([PlacedRobot(robot, world.course.home)], world)


A_SIMULATOR = instance_of(Simulator, "a simulator (time_step, packages and open)")


ObserveRule: TypeAlias = Callable[[Array, Array, Array], None]
"""(parameters, memory, state): see ``Simulation.observe``."""

SenseRule: TypeAlias = Callable[[Array, Array, Array], None]
"""(parameters, memory, signals): see ``Simulation.sense``."""

AdvanceRule: TypeAlias = Callable[[Array, Array, Array, float], None]
"""(parameters, memory, command, duration [s]): see ``Simulation.advance``."""


class SimulationRules(NamedTuple):
    """The three methods of a simulation as rules, which can be compiled."""

    observe: ObserveRule
    sense: SenseRule
    advance: AdvanceRule


@dataclass(frozen=True)
class RuleSimulation:
    """A simulation made of rules, whose missions can be compiled."""

    rules: SimulationRules
    parameters: Array
    memory: Array

    def observe(self, state: Array) -> None:
        """Fill ``state`` with the true state."""
        self.rules.observe(self.parameters, self.memory, state)

    def sense(self, signals: Array) -> None:
        """Fill ``signals`` with the true ranges [m] and the signals of other sensors."""
        self.rules.sense(self.parameters, self.memory, signals)

    def advance(self, command: Array, duration: float) -> None:
        """Drive with ``command`` for ``duration`` [s]."""
        self.rules.advance(self.parameters, self.memory, command, duration)


@runtime_checkable
class RuleSimulator(Protocol):
    """A simulator that opens ``RuleSimulation``s."""

    def choose_rules(self, world: "World", robots: Sequence["Robot"]) -> SimulationRules:
        """Return the rules of robots in a world, which depend on what their sensors measure only.

        Raises:
            InputError: the simulator cannot simulate so many in it.
        """
        ...
