"""The base classes of controllers, controller layers and localizations."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple, Protocol, TypeAlias

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import LARGEST, POSITIVE, TEXT, Rule, instance_of, mapping_of, require
from evoros.compilation.named_rules import Started
from evoros.filter.protocol import Filter
from evoros.robot.model import Robot

LAYER_ARGUMENTS = "parameters", "memory", "state", "leg", "readings", "time", "command"
"""A layer fills ``command`` from the localized ``state`` and returns True, or False to defer."""

ESTIMATOR_ARGUMENTS = "parameters", "memory", "rng", "readings", "pose", "time"
"""The rule of an estimator fills ``pose`` (POSE_SIZE,) from the readings of all sensors.

The readings include effects of filters and failures. In the first call, ``pose`` holds the true
initial pose; later calls must not read ``pose``.
"""


class EvolvedValue(NamedTuple):
    """A number of a controller that evolves, and its range."""

    path: str  # path relative to the declaring part, such as weights.3
    low: float
    high: float
    group: str = ""  # genes with the same group are inherited together


class ControllerPart:
    """A controller, or a part of one such as a layer."""

    @property
    def evolved(self) -> Mapping[str, EvolvedValue]:
        """The evolving values by gene name; none by default."""
        return {}


class Layer(ControllerPart, ABC):
    """One behaviour of a controller; the first layer that decides preempts later layers."""

    mode: str  # name in the column ``mode``; ``missions.csv`` has the share of ``avoiding``
    rule: Callable[..., bool]
    """The function that decides; static, so that numba can compile it.

    Its arguments are a subset of ``LAYER_ARGUMENTS``.
    """

    @abstractmethod
    def start(self, robot: Robot, period: float, rng: Generator) -> Started:
        """Return the parameters and memory of ``rule``; ``period`` is the control period [s]."""


class StartedLayer(NamedTuple):
    """The rule of a layer, with parameters and memory for a mission; layers may share a memory."""

    rule: Callable[..., bool]
    started: Started


class Estimator(ControllerPart, ABC):
    """A localization that computes the pose from the readings of the robot's sensors."""

    rule: Callable[..., None]
    """The function that computes the pose; static, so that numba can compile it.

    Its arguments are a subset of ``ESTIMATOR_ARGUMENTS``.
    """

    @abstractmethod
    def start_estimate(self, robot: Robot, period: float) -> Started:
        """Return the parameters and the memory of ``rule`` for one mission.

        ``period`` [s] is the control period. A robot without the required sensors raises an
        InputError.
        """


Localizer: TypeAlias = Filter | Estimator
LOCALIZATION = mapping_of(
    Filter | Estimator, "filters or an estimator (evoros.parts.Filter or Estimator)"
)


class AnyController(ControllerPart, ABC):
    """The base class of controllers in this process and of external controllers."""

    period_s: float  # time [s] between decisions
    localization: Mapping[str, Localizer] = MappingProxyType({})
    """Named filters of the pose, in order; an estimator, which replaces it, must come first."""

    @property
    @abstractmethod
    def modes(self) -> Sequence[str]:
        """The modes of the controller in the order of its layers, such as ``avoiding``."""


class Controller(AnyController):
    """Computes commands from readings and the localized pose by the rules of its layers."""

    @abstractmethod
    def open(
        self, robot: Robot, rng: Callable[[str], Generator]
    ) -> AbstractContextManager[Sequence[StartedLayer]]:
        """Start the layers for one mission; ``rng(name)`` returns the generator of a named part."""


@dataclass(frozen=True, eq=False)
class Briefing:
    """The mission as described to an external controller."""

    robot: Robot  # robot with the sensors of the design
    home: tuple[float, float, float, float]  # x, y, z [m], yaw [rad]
    route: Array  # (legs, 2) [m], waypoints in order
    acceptance_m: float  # distance at which a waypoint is reached
    time_limit_s: float
    seed: int  # 0 to 2^32 - 1, seed for all random draws of the controller in this mission


class Pilot(Protocol):
    """An external controller in lockstep with a mission."""

    def exchange(
        self, time: float, state: Array, leg: Array, readings: Array, command: Array
    ) -> int:
        """Send the values at ``time`` [s], wait for the answer, and fill ``command``.

        ``state`` is the localized state; values of a silent localization or sensor are NaN. Returns
        the number of the mode that decided, from 1, or 0 to keep the last command.

        Raises:
            PilotLost: the controller exited or did not answer in time; the mission is repeated.
            SimulationError: the answer is invalid, so repeating the mission would not help.
        """


class LiveController(AnyController):
    """A program, ROS nodes or an autopilot, which receives the whole route and reports its mode."""

    @property
    def files(self) -> Sequence[str]:
        """The controller's programs, nodes and binaries, for the digests in the manifest."""
        return ()

    @property
    def told_sensors(self) -> int | None:
        """The number of sensors, from the first, described to the program; None for all."""
        return None

    @property
    def version(self) -> str | None:
        """The version of ``files[0]`` for the manifest; empty if unknown, None if unversioned."""
        return None

    @abstractmethod
    def launch(self, briefing: Briefing) -> AbstractContextManager[Pilot]:
        """Start a new process for one mission; on exit, stop it and its children.

        A program that is missing or refuses to start raises an InputError; a slow one, a PilotLost.
        """


A_CONTROLLER = instance_of(AnyController, "a controller (a subclass of evoros.parts.Controller)")

COMMAND = Rule(
    f"a command of finite numbers with magnitudes of at most {LARGEST:g}",
    lambda v: bool(np.all(np.abs(v) <= LARGEST)),
)


def _are_texts(value: object) -> bool:
    return isinstance(value, list | tuple) and all(map(TEXT.holds, value))


RULES = {
    "period_s": POSITIVE,
    "localization": LOCALIZATION,
    "modes": Rule("a list of names", lambda v: _are_texts(v) and len(v) > 0),
}
LIVE_RULES = RULES | {"files": Rule("a list of paths", _are_texts)}


def check_controller(controller: Controller | LiveController) -> None:
    """Check the attributes of a controller; raise an InputError for an invalid one."""
    require(controller, LIVE_RULES if isinstance(controller, LiveController) else RULES)
