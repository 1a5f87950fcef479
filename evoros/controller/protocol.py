"""The protocols of controllers, their layers and their localizations."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import NamedTuple, Protocol, TypeAlias, runtime_checkable

from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import instance_of, mapping_of
from evoros.compilation.named_rules import Started
from evoros.filter.protocol import Filter
from evoros.robot.model import Robot

LAYER_ARGUMENTS = "parameters", "memory", "state", "leg", "readings", "time", "command"
"""The rule of a layer fills ``command`` and returns True, or returns False: others decide.

``state`` is as localized, and ``time`` is in seconds.
"""

ESTIMATOR_ARGUMENTS = "parameters", "memory", "rng", "readings", "pose", "time"
"""The rule of an estimator fills ``pose`` (POSE_SIZE,) from the readings of all sensors.

Filters and failures have changed the readings. At the first call, the pose is the true one, where
the mission starts; later ones must not be read.
"""


@runtime_checkable
class Layer(Protocol):
    """One behaviour of a controller. The first layer that takes the decision preempts the rest."""

    @property
    def mode(self) -> str:
        """Its name in the mode column: ``avoiding``, ``navigating`` ...

        The share of the decisions in the mode ``avoiding`` is a column of ``missions.csv``.
        """
        ...

    @property
    def rule(self) -> Callable[..., bool]:
        """Decide; a static method, so that numba can compile it.

        It takes the arguments that it uses, of those in ``LAYER_ARGUMENTS``.
        """
        ...

    def start(self, robot: Robot, period: float, rng: Generator) -> Started:
        """Return the parameters and the memory of ``rule`` for one mission.

        ``period`` is the controller's [s].
        """
        ...


class StartedLayer(NamedTuple):
    """A layer in a mission: its rule, and its start. Layers may share one memory."""

    rule: Callable[..., bool]
    started: Started


@runtime_checkable
class Estimator(Protocol):
    """A localization that computes the pose from the readings of the robot's sensors."""

    @property
    def rule(self) -> Callable[..., None]:
        """Compute the pose; a static method, so that numba can compile it.

        It takes the arguments that it uses, of those in ``ESTIMATOR_ARGUMENTS``.
        """
        ...

    def start_estimate(self, robot: Robot, period: float) -> Started:
        """Return the parameters and the memory of ``rule`` for one mission.

        ``period`` is the controller's [s].

        Raises:
            InputError: the robot lacks a sensor that the localization needs.
        """
        ...


Localizer: TypeAlias = Filter | Estimator
LOCALIZATION = mapping_of(
    Filter | Estimator, "filters (name, effect, rule and start) or a localization from sensors"
)


class _Periodic(Protocol):
    """The part that both kinds of controllers share."""

    @property
    def period_s(self) -> float:
        """Time between two decisions."""
        ...

    @property
    def localization(self) -> Mapping[str, Localizer]:
        """By name, the filters or the estimator that act in order on the pose.

        Filters change the true pose. An estimator, which comes first, replaces it.
        """
        ...

    @property
    def modes(self) -> Sequence[str]:
        """Its modes, for example ``avoiding``, ``navigating``; known without a start.

        The layers that ``Controller.open`` gives have them in the same order.
        """
        ...


@runtime_checkable
class Controller(_Periodic, Protocol):
    """Turns readings and the localized pose into commands, by layers that are rules."""

    def open(
        self, robot: Robot, rng: Callable[[str], Generator]
    ) -> AbstractContextManager[Sequence[StartedLayer]]:
        """Start the layers for one mission.

        ``rng(name)`` returns the generator of the named part for this mission.
        """
        ...


class EvolvedValue(NamedTuple):
    """A number of a controller that evolves with the design, and its range."""

    path: str  # dotted, from the part that declares it: weights.3
    low: float
    high: float
    group: str = ""  # of values that are inherited together


@runtime_checkable
class EvolvingPart(Protocol):
    """A controller, or a part of one, that declares which of its numbers evolve."""

    @property
    def evolved(self) -> Mapping[str, EvolvedValue]:
        """The values by the names of their genes."""
        ...


@dataclass(frozen=True, eq=False)
class Briefing:
    """The knowledge of a controller outside of this process before its mission."""

    robot: Robot  # with the sensors of the design
    home: tuple[float, float, float, float]  # x, y, z [m], yaw [rad]
    route: Array  # (legs, 2) waypoints in order [m]
    acceptance_m: float  # distance from a waypoint at which it is reached
    time_limit_s: float
    seed: int  # of this mission, 0 to 2^32 - 1, for all that the controller draws


class Pilot(Protocol):
    """A controller outside of this process in one mission, in lock-step with it."""

    def exchange(
        self, time: float, state: Array, leg: Array, readings: Array, command: Array
    ) -> int:
        """Tell the values at ``time`` [s], wait for the answer, and fill ``command``.

        ``state`` is as localized; the values of a silent localization or sensor are NaN. Returns
        the number of the mode that decided, from 1; 0 if none did, so that the last command stands.

        Raises:
            PilotLost: the controller ended, or did not answer in time. The mission is repeated.
            SimulationError: the answer cannot be used, and would be the same again.
        """
        ...


@runtime_checkable
class LiveController(_Periodic, Protocol):
    """A controller outside of this process: a program, ROS nodes, an autopilot.

    It has no rule to compile, gets the whole route, and reports its mode.
    """

    @property
    def files(self) -> Sequence[str]:
        """The paths of its programs, nodes and binaries, whose hashes the manifest records."""
        ...

    def launch(self, briefing: Briefing) -> AbstractContextManager[Pilot]:
        """Start a fresh process for one mission; leaving the context ends all that it started.

        Raises:
            InputError: the program is missing, or refuses the briefing.
            PilotLost: it was not ready in time.
        """
        ...


@runtime_checkable
class LimitedController(Protocol):
    """A live controller that can tell its program some sensors only, the first of a design."""

    @property
    def told_sensors(self) -> int:
        """The number of sensors."""
        ...


@runtime_checkable
class VersionedController(Protocol):
    """A live controller whose program has a version, which the manifest records."""

    @property
    def version(self) -> str:
        """The program's version; empty if it is unknown."""
        ...


A_CONTROLLER = instance_of(
    Controller | LiveController, "a controller (period_s, localization, modes, and open or launch)"
)
