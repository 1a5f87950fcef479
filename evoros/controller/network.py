"""A small neural network that steers: readings in sectors, bearing and speed in, two numbers out.

The rule and its helpers allocate nothing and use elementary functions of evoros alone.
"""

import math
from typing import NamedTuple

import numpy as np

from evoros.base import elementary
from evoros.base.arrays import (
    DRIVE_SPEED,
    SPEED,
    STEERING,
    TO_X,
    TO_Y,
    YAW,
    Array,
    X,
    Y,
)
from evoros.base.compilable import compilable

# The parameters of the rules. Then follow, for each reading, the range [m] from which on it sees
# nothing, two sectors and its shares in them, and last the weights.
(
    SECTORS,
    HIDDEN,
    SYMMETRIC,  # 1 or 0
    RECURRENT,  # 1 or 0
    RANGE,  # [m]
    GAIN,
    CRUISE,  # [m/s]
    SLOW,  # [m/s]
    FAST,  # [m/s]
    FULL_LOCK,  # [rad]
    CHANNELS,  # where the entries of the readings begin
) = range(11)
ENTRY = 5
"""The number of parameters of a reading: range, sector, share in it, next sector, share in it."""
OTHERS = 2
"""The number of inputs besides the sectors: bearing and speed."""
AUTHORITY = 2.0
"""Full locks by which the network can change the steering: from one lock to the other."""


class Weight(NamedTuple):
    """One weight: its name, and the neuron to which it leads."""

    name: str
    neuron: str


def list_weights(sectors: int, hidden: int, symmetric: bool, recurrent: bool) -> list[Weight]:
    """List the weights of a network in their order.

    Each hidden neuron has its bias and the weights of the sectors from right to left, of the
    bearing and of the speed. A recurrent one has those of the last values of all hidden neurons
    too, and of their twins in a symmetric network. The neurons of steering and speed have a
    weight of each hidden neuron, and a bias but for the steering of a symmetric network.
    """
    sides = [f"sector{i}" for i in range(sectors)]
    neurons = [f"hidden{i}" for i in range(hidden)]
    before = neurons if recurrent else []
    twins = [f"twin{i}" for i in range(hidden)] if recurrent and symmetric else []
    inputs = ["bias", *sides, "bearing", "speed", *before, *twins]
    weights = [Weight(f"{each}_from_{name}", each) for each in neurons for name in inputs]
    bias = [] if symmetric else ["bias"]
    weights += [Weight(f"steering_from_{name}", "steering") for name in [*bias, *neurons]]
    return weights + [Weight(f"speed_from_{name}", "speed") for name in ["bias", *neurons]]


def memory_size(sectors: int, hidden: int) -> int:
    """Return the size of the memory: the inputs, the neurons and their twins, now and before."""
    return sectors + OTHERS + 4 * hidden


def share_sectors(yaws: list[float], sectors: int, span: float) -> Array:
    """Return for each reading's yaw [rad] two sectors and its shares in them, (readings, 4).

    The middles of the outermost sectors are ``span`` [rad] apart. The share falls linearly from 1
    in the middle of a sector to 0 in that of the next one, and beyond the outermost as well. A
    reading without a yaw (NaN) has no share. Mirror images have exactly the same shares.
    """
    entries = np.zeros((len(yaws), ENTRY - 1))
    middle = (sectors - 1) // 2
    width = span / max(sectors - 1, 1)
    for entry, yaw in zip(entries, yaws, strict=True):
        if math.isnan(yaw):
            continue
        wrapped = elementary.atan2(*elementary.sin_cos(yaw))
        steps, side = abs(wrapped) / width, 1 if wrapped >= 0 else -1
        inner = int(steps)
        shares = (1.0 - (steps - inner), steps - inner)
        for place, (number, share) in enumerate(zip((inner, inner + 1), shares, strict=True)):
            if number <= middle:
                entry[2 * place : 2 * place + 2] = middle + side * number, share
    return entries


@compilable
def look(parameters: Array, memory: Array, readings: Array) -> bool:
    """Write the sectors, 0 (free) to 1 (touched), to the memory; return if any is not free.

    A silent sensor (NaN) sees nothing.
    """
    sectors = int(parameters[SECTORS])
    limit = float(parameters[RANGE])
    for i in range(sectors):
        memory[i] = 0.0
    near = False
    for i in range(len(readings)):
        reading = float(readings[i])
        if reading < float(parameters[CHANNELS + ENTRY * i]):
            closeness = 1.0 - max(reading, 0.0) / limit
            for place in range(2):
                at = CHANNELS + ENTRY * i + 1 + 2 * place
                sector, share = int(parameters[at]), float(parameters[at + 1])
                memory[sector] = max(float(memory[sector]), share * closeness)
                near = near or share > 0.0
    return near


@compilable
def command_from(
    parameters: Array, memory: Array, state: Array, leg: Array, count: int, command: Array
) -> bool:
    """Fill the command from the sectors in the memory; False if the pose is silent (NaN).

    ``count`` is the number of readings. Without weights the robot heads for the waypoint.
    """
    bearing = elementary.atan2(leg[TO_Y] - state[Y], leg[TO_X] - state[X])
    error = bearing - float(state[YAW])
    speed = float(state[SPEED])
    if math.isnan(error + speed):
        return False
    error = (error + math.pi) % (2.0 * math.pi) - math.pi
    sectors, hidden = int(parameters[SECTORS]), int(parameters[HIDDEN])
    memory[sectors] = error / math.pi
    memory[sectors + 1] = speed / float(parameters[FAST])
    weights = CHANNELS + ENTRY * count
    at = update_hidden(parameters, memory, weights)
    turn, pace = sum_outputs(parameters, memory, at, sectors + OTHERS, hidden)
    lock = float(parameters[FULL_LOCK])
    heading = min(max(float(parameters[GAIN]) * error, -lock), lock)
    steering = heading + AUTHORITY * lock * elementary.tanh(turn)
    change = elementary.tanh(pace)
    cruise = float(parameters[CRUISE])
    end = float(parameters[FAST]) if change > 0.0 else float(parameters[SLOW])
    command[DRIVE_SPEED] = cruise + abs(change) * (end - cruise)
    command[STEERING] = min(max(steering, -lock), lock)
    return True


@compilable
def update_hidden(parameters: Array, memory: Array, at: int) -> int:
    """Compute the hidden neurons, and their twins, which see the mirror image of the inputs.

    ``at`` is where their weights begin; where those of the outputs do is returned. The neurons of
    the step before are in the memory behind those of this one.
    """
    sectors, hidden = int(parameters[SECTORS]), int(parameters[HIDDEN])
    symmetric, recurrent = parameters[SYMMETRIC] > 0.0, parameters[RECURRENT] > 0.0
    first = sectors + OTHERS  # of the hidden neurons; their twins follow
    before = first + 2 * hidden
    for i in range(2 * hidden):
        memory[before + i] = memory[first + i]
    bearing, speed = float(memory[sectors]), float(memory[sectors + 1])
    for i in range(hidden):
        own = float(parameters[at])
        twin = own
        at += 1
        for k in range(sectors):
            own += float(parameters[at + k]) * float(memory[k])
            twin += float(parameters[at + k]) * float(memory[sectors - 1 - k])
        at += sectors
        own += float(parameters[at]) * bearing
        twin -= float(parameters[at]) * bearing
        own += float(parameters[at + 1]) * speed
        twin += float(parameters[at + 1]) * speed
        at += OTHERS
        if recurrent:
            for k in range(hidden):
                own += float(parameters[at + k]) * float(memory[before + k])
                twin += float(parameters[at + k]) * float(memory[before + hidden + k])
            at += hidden
        if recurrent and symmetric:
            for k in range(hidden):
                own += float(parameters[at + k]) * float(memory[before + hidden + k])
                twin += float(parameters[at + k]) * float(memory[before + k])
            at += hidden
        memory[first + i] = elementary.tanh(own)
        memory[first + hidden + i] = elementary.tanh(twin)
    return at


@compilable
def sum_outputs(
    parameters: Array, memory: Array, at: int, first: int, hidden: int
) -> tuple[float, float]:
    """Return the sums of steering and speed, whose weights begin at ``at``.

    In a symmetric network the mirror image of the inputs turns the steering around, and leaves the
    speed as it is.
    """
    symmetric = parameters[SYMMETRIC] > 0.0
    turn = 0.0
    if not symmetric:
        turn = float(parameters[at])
        at += 1
    for i in range(hidden):
        value = float(memory[first + i])
        if symmetric:
            value -= float(memory[first + hidden + i])
        turn += float(parameters[at + i]) * value
    at += hidden
    pace = float(parameters[at])
    for i in range(hidden):
        value = float(memory[first + i])
        if symmetric:
            value += float(memory[first + hidden + i])
        pace += float(parameters[at + 1 + i]) * value
    return turn, pace
