"""A neural network controller with weights that evolve together with the design."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Annotated, NamedTuple

import numpy as np
from numpy.random import Generator

from evoros.base import checks, elementary
from evoros.base.arrays import DRIVE_SPEED, SPEED, STEERING, TO_X, TO_Y, YAW, Array, Matrix, X, Y
from evoros.base.compilable import compilable
from evoros.controller import protocol
from evoros.robot.model import Robot


class Parameters(NamedTuple):
    """The parameters of the network's rules."""

    symmetric: float  # 1 or 0
    recurrent: float  # 1 or 0
    waypoint: float  # 1, or 0 if the bearing of the waypoint is no input
    range: float  # [m]
    gain: float
    cruise: float  # [m/s]
    slow: float  # [m/s]
    fast: float  # [m/s]
    full_lock: float  # [rad]
    limits: Array  # [m], reading of each sensor without obstacles in range
    shares: Matrix  # (readings, 4): two sectors, each followed by the share in it
    hidden: Matrix  # weights of each hidden neuron
    steering: Array  # weights of the hidden neurons, after a bias unless symmetric
    speed: Array  # bias and weights of the hidden neurons


class Memory(NamedTuple):
    """The inputs, and current and previous values of the hidden neurons and their twins."""

    sectors: Array  # 0 (free) to 1 (contact), right to left
    neurons: Array
    twins: Array  # hidden neurons for the mirrored inputs
    neurons_before: Array
    twins_before: Array


OTHERS = 2  # number of inputs besides the sectors: bearing and speed
AUTHORITY = 2.0  # maximum steering correction in units of full lock, from lock to lock


class Weight(NamedTuple):
    """The name of a weight, and the name of the neuron that it feeds."""

    name: str
    neuron: str


def list_weights(
    sectors: int, hidden: int, symmetric: bool, recurrent: bool, waypoint: bool
) -> list[Weight]:
    """List the weights of a network in order.

    Each hidden neuron has a bias and weights for the sectors from right to left, the bearing (with
    ``waypoint``) and the speed. A hidden neuron of a recurrent network also has weights for the
    previous values of all hidden neurons and, in a symmetric network, of their twins. Steering and
    speed have a weight for each hidden neuron, and a bias except for the steering of a symmetric
    network.
    """
    sides = [f"sector{i}" for i in range(sectors)]
    neurons = [f"hidden{i}" for i in range(hidden)]
    before = neurons if recurrent else []
    twins = [f"twin{i}" for i in range(hidden)] if recurrent and symmetric else []
    bearing = ["bearing"] if waypoint else []
    inputs = ["bias", *sides, *bearing, "speed", *before, *twins]
    weights = [Weight(f"{neuron}_from_{name}", neuron) for neuron in neurons for name in inputs]
    bias = [] if symmetric else ["bias"]
    weights += [Weight(f"steering_from_{name}", "steering") for name in [*bias, *neurons]]
    return weights + [Weight(f"speed_from_{name}", "speed") for name in ["bias", *neurons]]


def split_weights(
    weights: Sequence[float], hidden: int, symmetric: bool
) -> tuple[Matrix, Array, Array]:
    """Return the weights of the hidden neurons, of steering and of speed."""
    speed = len(weights) - hidden - 1
    steering = speed - hidden - (not symmetric)
    values = np.array(weights, dtype=float)
    return values[:steering].reshape(hidden, -1), values[steering:speed], values[speed:]


def share_sectors(yaws: list[float], sectors: int, span: float) -> Array:
    """Return two sectors and the share in each for each reading's yaw [rad], (readings, 4).

    The centres of the outermost sectors are ``span`` [rad] apart. A share falls linearly from 1 at
    the centre of a sector to 0 at the centre of the next sector, and at the same rate beyond the
    outermost centres. A reading without a yaw (NaN) has no share. Mirror images have exactly equal
    shares.
    """
    entries = np.zeros((len(yaws), 4))
    middle = (sectors - 1) // 2
    width = span / max(sectors - 1, 1)
    for entry, yaw in zip(entries, yaws, strict=True):
        if math.isnan(yaw):
            continue
        wrapped = elementary.atan2(*elementary.sin_cos(yaw))
        steps, side = abs(wrapped) / width, 1 if wrapped >= 0 else -1
        inner = int(steps)
        shares = (1.0 - (steps - inner), steps - inner)
        for place, share in enumerate(shares):
            if inner + place <= middle:
                entry[2 * place : 2 * place + 2] = middle + side * (inner + place), share
    return entries


@compilable
def look(parameters: Parameters, sectors: Array, readings: Array) -> bool:
    """Fill the sectors; return True if any is occupied. A silent sensor (NaN) detects nothing."""
    for i in range(len(sectors)):
        sectors[i] = 0.0
    near = False
    for i in range(len(readings)):
        reading = float(readings[i])
        if reading < float(parameters.limits[i]):
            closeness = 1.0 - max(reading, 0.0) / parameters.range
            for place in range(0, 4, 2):
                sector = int(parameters.shares[i, place])
                share = float(parameters.shares[i, place + 1])
                sectors[sector] = max(float(sectors[sector]), share * closeness)
                near = near or share > 0.0
    return near


@compilable
def command_from(
    parameters: Parameters, memory: Memory, state: Array, leg: Array, command: Array
) -> bool:
    """Compute the command from the sectors in memory; return False without a pose (NaN)."""
    bearing = elementary.atan2(leg[TO_Y] - state[Y], leg[TO_X] - state[X])
    error = bearing - float(state[YAW])
    speed = float(state[SPEED])
    if math.isnan(error + speed):
        return False
    error = parameters.waypoint * ((error + math.pi) % (2.0 * math.pi) - math.pi)
    update_hidden(parameters, memory, error / math.pi, speed / parameters.fast)
    turn, pace = sum_outputs(parameters, memory)
    lock = parameters.full_lock
    heading = min(max(parameters.gain * error, -lock), lock)
    steering = heading + AUTHORITY * lock * elementary.tanh(turn)
    change = elementary.tanh(pace)
    end = parameters.fast if change > 0.0 else parameters.slow
    command[DRIVE_SPEED] = parameters.cruise + abs(change) * (end - parameters.cruise)
    command[STEERING] = min(max(steering, -lock), lock)
    return True


@compilable
def update_hidden(parameters: Parameters, memory: Memory, bearing: float, speed: float) -> None:
    """Update the hidden neurons, and their twins, whose inputs are mirrored."""
    symmetric, recurrent = parameters.symmetric > 0.0, parameters.recurrent > 0.0
    hidden, sectors = len(memory.neurons), len(memory.sectors)
    for i in range(hidden):
        memory.neurons_before[i] = memory.neurons[i]
        memory.twins_before[i] = memory.twins[i]
    for i in range(hidden):
        weights = parameters.hidden[i]
        neuron = twin = float(weights[0])
        for k in range(sectors):
            neuron += float(weights[1 + k]) * float(memory.sectors[k])
            twin += float(weights[1 + k]) * float(memory.sectors[sectors - 1 - k])
        at = 1 + sectors
        neuron += float(weights[at]) * bearing
        twin -= float(weights[at]) * bearing
        neuron += float(weights[at + 1]) * speed
        twin += float(weights[at + 1]) * speed
        at += OTHERS
        if recurrent:
            for k in range(hidden):
                neuron += float(weights[at + k]) * float(memory.neurons_before[k])
                twin += float(weights[at + k]) * float(memory.twins_before[k])
            at += hidden
        if recurrent and symmetric:
            for k in range(hidden):
                neuron += float(weights[at + k]) * float(memory.twins_before[k])
                twin += float(weights[at + k]) * float(memory.neurons_before[k])
        memory.neurons[i] = elementary.tanh(neuron)
        memory.twins[i] = elementary.tanh(twin)


@compilable
def sum_outputs(parameters: Parameters, memory: Memory) -> tuple[float, float]:
    """Return the sums of the outputs for steering and speed."""
    symmetric = parameters.symmetric > 0.0
    first = 0 if symmetric else 1
    turn = 0.0 if symmetric else float(parameters.steering[0])
    pace = float(parameters.speed[0])
    for i in range(len(memory.neurons)):
        difference = float(memory.neurons[i])
        total = difference
        if symmetric:
            difference -= float(memory.twins[i])
            total += float(memory.twins[i])
        turn += float(parameters.steering[first + i]) * difference
        pace += float(parameters.speed[1 + i]) * total
    return turn, pace


ODD = checks.Rule(
    "an odd integer of at most 99", lambda v: checks.is_whole(v) and v % 2 == 1 and 0 < v < 100
)
SPAN = checks.Rule(
    "an angle greater than 0 and at most 360", lambda v: checks.is_number(v) and 0 < v <= 360
)
NUMBERS = checks.Rule(
    "a list of numbers", lambda v: isinstance(v, list | tuple) and all(map(checks.is_number, v))
)


@dataclass(frozen=True)
@checks.checked
class Neural(protocol.Controller):
    """A network with one hidden layer from readings, bearing and speed to steering and speed.

    The inputs are the nearest reading in each of ``sectors`` as a fraction of ``range_m``, the
    bearing to the waypoint, and the speed. The outputs modify the command of a robot that heads for
    the waypoint at ``speed_mps``, or straight ahead without ``waypoint``. In a ``symmetric``
    network, mirrored inputs give the mirrored command. In a ``recurrent`` network, the hidden
    neurons also receive their previous values.

    The default weights are 0; ``list_weights`` gives their order. If the weights evolve, each is a
    gene from ``-weight_limit`` to ``weight_limit``.
    """

    modes = ("avoiding", "navigating")  # first mode: an obstacle is within ``range_m``
    sectors: Annotated[int, ODD] = 5
    span_deg: Annotated[float, SPAN] = 180.0  # angle between the centres of the outermost sectors
    range_m: Annotated[float, checks.POSITIVE] = 2.0
    hidden: Annotated[int, replace(checks.COUNT, limit=100)] = 4
    symmetric: Annotated[bool, checks.FLAG] = True
    recurrent: Annotated[bool, checks.FLAG] = False
    waypoint: Annotated[bool, checks.FLAG] = True  # whether the bearing of the waypoint is an input
    speed_mps: Annotated[float, checks.POSITIVE] = 0.29
    min_speed_mps: Annotated[float, checks.NOT_NEGATIVE] = 0.1
    gain: Annotated[float, checks.POSITIVE] = 1.5
    weights: Annotated[Sequence[float] | None, NUMBERS] = None
    evolve: Annotated[bool, checks.FLAG] = True
    weight_limit: Annotated[float, checks.POSITIVE] = 3.0
    period_s: Annotated[float, checks.POSITIVE] = 0.1
    localization: Annotated[Mapping[str, protocol.Localizer], protocol.LOCALIZATION] = field(
        default_factory=dict
    )

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
    def _listed(self) -> list[Weight]:
        kind = self.symmetric, self.recurrent, self.waypoint
        return list_weights(self.sectors, self.hidden, *kind)

    @property
    def evolved(self) -> Mapping[str, protocol.EvolvedValue]:
        """The genes of the weights, by name; genes of one neuron are inherited together."""
        if not self.evolve:
            return {}
        limit = float(self.weight_limit)
        return {
            weight.name: protocol.EvolvedValue(f"weights.{i}", -limit, limit, weight.neuron)
            for i, weight in enumerate(self._listed)
        }

    @contextmanager
    def open(
        self, robot: Robot, rng: Callable[[str], Generator]
    ) -> Iterator[Sequence[protocol.StartedLayer]]:
        """Start the network for a mission, with one memory for the rules of both modes."""
        parameters, hidden = self._parameters(robot), [np.zeros(self.hidden) for _ in range(4)]
        memory = Memory(np.zeros(self.sectors), *hidden)
        yield [protocol.StartedLayer(rule, (parameters, memory)) for rule in (avoid, command_from)]

    def _parameters(self, robot: Robot) -> Parameters:
        fastest = float(robot.drive.max_speed_mps)
        if self.speed_mps > fastest:
            rule = f"must be at most the robot's maximum speed, {fastest:g}"
            raise checks.invalid(self, "speed_mps", self.speed_mps, rule, "lower it")
        span = math.radians(self.span_deg)
        limits = [
            min(self.range_m, channel.high)  # reading of a sensor without obstacles in range
            for sensor in robot.mounted_sensors()
            for channel in sensor.channels
        ]
        weights = self.weights or ()
        hidden, steering, speed = split_weights(weights, self.hidden, self.symmetric)
        if not self.waypoint:
            hidden = np.insert(hidden, 1 + self.sectors, 0.0, axis=1)  # weights of the bearing
        return Parameters(
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
            shares=share_sectors(robot.channel_yaws(), self.sectors, span),
            hidden=hidden,
            steering=steering,
            speed=speed,
        )


def avoid(
    parameters: Parameters,
    memory: Memory,
    state: Array,
    leg: Array,
    readings: Array,
    command: Array,
) -> bool:
    """Fill the sectors, and command the drive if an obstacle is within range."""
    if not look(parameters, memory.sectors, readings):
        return False
    return command_from(parameters, memory, state, leg, command)
