"""A neural network controller with weights that evolve together with the design."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np
from numpy.random import Generator

from evoros.base import checks
from evoros.base.arrays import Array
from evoros.controller import network
from evoros.controller.protocol import (
    LOCALIZATION,
    Controller,
    EvolvedValue,
    Localizer,
    StartedLayer,
)
from evoros.robot.model import Robot

ODD = checks.Rule(
    "an odd integer, at most 99", lambda v: checks.is_whole(v) and v % 2 == 1 and 0 < v < 100
)
SPAN = checks.Rule(
    "an angle greater than 0, at most 360", lambda v: checks.is_number(v) and 0 < v <= 360
)
NUMBERS = checks.Rule(
    "a list of numbers", lambda v: isinstance(v, list | tuple) and all(map(checks.is_number, v))
)


@dataclass(frozen=True)
@checks.checked
class Neural(Controller):
    """A network with one hidden layer that maps readings, bearing and speed to steering and speed.

    The inputs are the nearest reading in each of ``sectors`` as a fraction of ``range_m``, the
    bearing to the waypoint, and the speed. The outputs modify the command of a robot that heads for
    the waypoint at ``speed_mps``, or straight ahead without ``waypoint``. In a ``symmetric``
    network, mirrored inputs give the mirrored command. In a ``recurrent`` network, the hidden
    neurons also receive their previous values.

    The default weights are 0; ``list_weights`` gives their order. If the weights evolve, each is a
    gene from ``-weight_limit`` to ``weight_limit``.
    """

    modes = ("avoiding", "navigating")
    """The first mode applies while something is within ``range_m``, the second otherwise."""
    sectors: Annotated[int, ODD] = 5
    span_deg: Annotated[float, SPAN] = 180.0  # angle between the centres of the outermost sectors
    range_m: Annotated[float, checks.POSITIVE] = 2.0
    hidden: Annotated[int, replace(checks.COUNT, limit=100)] = 4
    symmetric: Annotated[bool, checks.FLAG] = True
    recurrent: Annotated[bool, checks.FLAG] = False
    waypoint: Annotated[bool, checks.FLAG] = True  # true if the waypoint's bearing is an input
    speed_mps: Annotated[float, checks.POSITIVE] = 0.29
    min_speed_mps: Annotated[float, checks.NOT_NEGATIVE] = 0.1
    gain: Annotated[float, checks.POSITIVE] = 1.5
    weights: Annotated[Sequence[float] | None, NUMBERS] = None
    evolve: Annotated[bool, checks.FLAG] = True
    weight_limit: Annotated[float, checks.POSITIVE] = 3.0
    period_s: Annotated[float, checks.POSITIVE] = 0.1
    localization: Annotated[Mapping[str, Localizer], LOCALIZATION] = field(default_factory=dict)

    def __post_init__(self) -> None:
        checks.check_order(self, "min_speed_mps", "speed_mps")
        count = len(self._listed)
        if self.weights is None:
            object.__setattr__(self, "weights", (0.0,) * count)
        elif len(self.weights) != count:
            rule, given = (
                f"must be {count} numbers for this network",
                f"{len(self.weights)} numbers",
            )
            raise checks.invalid(self, "weights", given, rule, "use null for zeros")

    @property
    def _listed(self) -> list[network.Weight]:
        kind = self.symmetric, self.recurrent, self.waypoint
        return network.list_weights(self.sectors, self.hidden, *kind)

    @property
    def evolved(self) -> Mapping[str, EvolvedValue]:
        """The weights' genes by name; all genes of a neuron are inherited together."""
        if not self.evolve:
            return {}
        limit = float(self.weight_limit)
        return {
            weight.name: EvolvedValue(f"weights.{i}", -limit, limit, weight.neuron)
            for i, weight in enumerate(self._listed)
        }

    @contextmanager
    def open(
        self, robot: Robot, rng: Callable[[str], Generator]
    ) -> Iterator[Sequence[StartedLayer]]:
        """Start the network for one mission, with one memory for the rules of both modes."""
        parameters, hidden = self._parameters(robot), [np.zeros(self.hidden) for _ in range(4)]
        memory = network.Memory(np.zeros(self.sectors), *hidden)
        yield [StartedLayer(rule, (parameters, memory)) for rule in (avoid, network.command_from)]

    def _parameters(self, robot: Robot) -> network.Parameters:
        fastest = float(robot.drive.max_speed_mps)
        if self.speed_mps > fastest:
            rule = f"must be at most the robot's maximum speed, {fastest:g}"
            raise checks.invalid(self, "speed_mps", self.speed_mps, rule, "lower it")
        span = math.radians(self.span_deg)
        limits = [
            min(self.range_m, channel.high)  # reading of a sensor when nothing is in range
            for sensor in robot.mounted_sensors()
            for channel in sensor.channels
        ]
        weights = self.weights or ()
        hidden, steering, speed = network.split_weights(weights, self.hidden, self.symmetric)
        if not self.waypoint:
            hidden = np.insert(hidden, 1 + self.sectors, 0.0, axis=1)  # weights of the bearing
        return network.Parameters(
            symmetric=self.symmetric,
            recurrent=self.recurrent,
            waypoint=self.waypoint,
            range=self.range_m,
            gain=self.gain,
            cruise=self.speed_mps,
            slow=self.min_speed_mps,
            fast=fastest,
            full_lock=robot.drive.steering_limit,
            limits=np.array(limits, dtype=float),
            shares=network.share_sectors(robot.channel_yaws(), self.sectors, span),
            hidden=hidden,
            steering=steering,
            speed=speed,
        )


def avoid(
    parameters: network.Parameters,
    memory: network.Memory,
    state: Array,
    leg: Array,
    readings: Array,
    command: Array,
) -> bool:
    """Fill the sectors, and command the drive if something is within range."""
    if not network.look(parameters, memory.sectors, readings):
        return False
    return network.command_from(parameters, memory, state, leg, command)
