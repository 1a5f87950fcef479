"""The vocabulary of evoros: what the parts say to each other.

Imports numpy and the standard library only, so that every part can import it.

Descriptions (robots, worlds, filters, controllers ...) are frozen. ``start()`` and ``open()``
give the fresh, mutable thing. What runs inside a mission is a *rule*: a plain function of
arrays, with its parameters and its memory as float64 arrays. A rule never allocates, never
raises and never keeps anything outside its arrays, so that the same source can be called step
by step or compiled. Write ``x * x`` and ``math.sqrt`` in rules; ``x ** 2``, ``math.hypot`` and
numpy reductions do not give the same bits when compiled.

Units are SI: metres, seconds, radians, kilograms; a name that ends in ``_deg`` is in degrees.
World frame: z up. Robot frame: x forward, y left, yaw positive to the left.
"""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias, runtime_checkable

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

if TYPE_CHECKING:
    from evoros.robot import Robot
    from evoros.world import World

Array: TypeAlias = NDArray[np.float64]

# The state of the robot: a float64 array of STATE_SIZE values, world frame.
X, Y, YAW, SPEED, YAW_RATE, CONTACT = range(6)
"""x [m], y [m], yaw [rad], forward speed [m/s], yaw rate [rad/s], touches an obstacle (0 or 1)."""
STATE_SIZE = 6
POSE_SIZE = 4
"""The first values of the state are what a localization reports: x, y, yaw and speed."""

# The leg of the route that is being driven: a float64 array of LEG_SIZE values.
FROM_X, FROM_Y, TO_X, TO_Y = range(4)
LEG_SIZE = 4

# The command of a controller: a float64 array of COMMAND_SIZE values.
DRIVE_SPEED, STEERING = range(2)
"""Speed [m/s] of the rear axle's centre; steering [rad] of the bicycle model, left positive."""
COMMAND_SIZE = 2


@dataclass(frozen=True)
class Mount:
    """One sensor on the robot: its type and the pose of its frame in the frame of ``link``."""

    sensor: str  # name of the sensor type, a key of the design's ``sensors``
    link: str
    x_m: float
    y_m: float
    z_m: float
    yaw_deg: float  # left positive
    pitch_deg: float  # nose up positive


@dataclass(frozen=True)
class Design:
    """What distinguishes one individual: its sensors, and other evolved values by their key.

    ``values`` maps the key of a configuration value (``controller.avoidance.range_m``) to the
    value that this individual has instead of the configured one.
    """

    mounts: tuple[Mount, ...]
    values: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Channels:
    """What a filter may know of the n values that it filters."""

    low: Array  # (n,) least value, -inf where there is none
    high: Array  # (n,) greatest value: the range of a sensor that sees nothing
    position: Array  # (n, 3) where on the robot [m], zeros for a pose
    period: float  # time between two samples [s]

    @property
    def size(self) -> int:
        """How many values."""
        return len(self.low)


FilterRule: TypeAlias = Callable[[Array, Array, Generator, Array, float], None]
"""(parameters, memory, generator, values, time [s]): changes values in place; NaN is silence."""

LayerRule: TypeAlias = Callable[[Array, Array, Array, Array, Array, float, Array], bool]
"""(parameters, memory, state, leg, readings [m], time [s], command) -> took the decision?

``state`` is as localized; the rule fills ``command`` only where it returns True.
"""


@runtime_checkable
class Filter(Protocol):
    """Stands between a source (sensors, localization) and the controller: noise, delay, faults."""

    @property
    def rule(self) -> FilterRule:
        """What it does to each sample."""
        ...

    def start(self, channels: Channels, onset: Array, rng: Generator) -> tuple[Array, Array]:
        """Parameters and memory for one mission.

        ``onset`` (n,) is the time [s] from which the filter acts on each channel: zeros for an
        ordinary filter, infinity for a channel that it leaves alone.
        """
        ...


@dataclass(frozen=True)
class Fault:
    """A filter that acts on each channel from its own time on.

    The random draws of a fault go by its name; faults of one name are numbered in their order.
    """

    filter: Filter
    onset: Array  # (n,) [s], infinity: never
    name: str = ""  # empty: that of the filter's class

    def __post_init__(self) -> None:
        if not self.name:
            object.__setattr__(self, "name", type(self.filter).__name__)


@runtime_checkable
class Failure(Protocol):
    """Chooses which sensors fail and when."""

    def draw(self, channels: Channels, rng: Generator) -> tuple[Fault, ...]:
        """The faults of one mission; ``channels`` covers all sensors of the robot."""
        ...


@runtime_checkable
class Sensor(Protocol):
    """A type of range sensor: what it sees along which rays, how often, how well."""

    @property
    def period_s(self) -> float:
        """Time between two readings."""
        ...

    @property
    def range_min_m(self) -> float:
        """The least that it can read."""
        ...

    @property
    def range_max_m(self) -> float:
        """What it reads where it sees nothing."""
        ...

    @property
    def filters(self) -> Mapping[str, Filter]:
        """By name, applied in order to the readings of this type: first of all its noise."""
        ...

    @property
    def size_m(self) -> Sequence[float]:
        """Lengths (3,) of its body, a box about its frame's origin; it touches nothing."""
        ...

    @property
    def mass_kg(self) -> float:
        """Mass of its body, greater than 0: simulators drop a body without mass."""
        ...

    def rays(self) -> Array:
        """(k, 3) unit vectors in the sensor's frame (x forward); the nearest hit is the reading."""
        ...

    def gazebo(self, name: str) -> str:
        """The ``<sensor>`` element (SDF) that makes Gazebo simulate this sensor."""
        ...


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


class Pool(Protocol):
    """A started executor. ``submit`` is that of ``concurrent.futures.Executor``."""

    def submit(self, function: Callable[..., Any], /, *args: Any) -> "Future[Any]":
        """Call ``function(*args)`` in a worker; both must pickle.

        The future raises what the function raised, or WorkerLost where the call crashed its
        process or hung, once more often than it may be retried.
        """
        ...


@runtime_checkable
class Executor(Protocol):
    """Where missions are computed. No result may depend on it."""

    @property
    def workers(self) -> int:
        """How many calls run at the same time."""
        ...

    def open(self) -> AbstractContextManager[Pool]:
        """Start the workers; leaving the context ends every one of them, whatever it does."""
        ...
