"""The stages, the numbers and the arrays of the mission loop."""

from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeAlias, TypeVar

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from evoros.base.arrays import Array
from evoros.simulator.protocol import AdvanceRule, ObserveRule, SenseRule

Integers: TypeAlias = NDArray[np.int64]
Truths: TypeAlias = NDArray[np.bool_]

RUNNING, COMPLETED, COLLISION, TIME_LIMIT = range(4)
"""Ends of a robot's part of a mission; RUNNING: the mission ended before it."""

VISITED, COLLISIONS, FIRST_COLLISION, TOUCHING, DECIDED, ENDED, END_TICK, END_ROW = range(8)
"""Rows of ``Arrays.counts``, for each robot: waypoints reached; contacts begun, and the tick of the
first one, -1 without any; whether it touches something; the mode of the last decision; its end, and
the tick and the row of it."""
COUNTS = 8


class FilterStage(NamedTuple):
    """A rule that fills or changes values: of a sensor, a filter or a localization."""

    every: int  # ticks between two samples
    rule: Callable[[Array, Array, Generator, Array, Array, float], None]
    parameters: Array
    memory: Array
    rng: Generator
    source: Array  # a view of the values that it reads
    values: Array  # a view of the values that it changes
    agent: int = 0  # the index of its robot
    clock: int = 0  # the place in ``Arrays.clocks`` of the time that the rule gets


class LayerStage(NamedTuple):
    """A layer of a controller."""

    rule: Callable[[Array, Array, Array, Array, Array, float, Array], bool]
    parameters: Array
    memory: Array


S = TypeVar("S", FilterStage, LayerStage)


def get_stage(kind: type[S], stages: Sequence[S], place: int) -> S:
    """Return a stage; compiled code reads it from a table of ``evoros.mission.stage_tables``."""
    return stages[place]


class LoopInputs(NamedTuple):
    """The rules of a mission, with their parameters and memory; robots come one after another."""

    observe: ObserveRule
    sense: SenseRule
    advance: AdvanceRule
    parameters: Array  # of the simulation
    memory: Array  # of the simulation
    filters: tuple[FilterStage, ...]
    localization: tuple[FilterStage, ...]
    layers: tuple[LayerStage, ...]
    actuation: tuple[FilterStage, ...]  # from the controllers' commands to the drives
    robots: int


class Agents(NamedTuple):
    """The duties of each robot, and the places of its values in the arrays."""

    acceptance: Array  # distance [m] from a waypoint at which it is reached
    end_on_collision: Truths
    awaited: Truths  # whether the mission goes on until the robot has ended
    sense_every: Integers  # [ticks]
    decide_every: Integers  # [ticks]
    # The start of each robot's part, and the end of the last part.
    routes: Integers  # in ``Arrays.routes``
    layers: Integers  # in ``LoopInputs.layers``
    readings: Integers  # in ``Arrays.readings``
    estimates: Integers  # among the columns of a trajectory for estimated poses


class Timing(NamedTuple):
    """Periods in ticks, and the part of the mission that is to run."""

    tick: float  # the greatest common divisor of all periods [s]
    record_every: int
    limit: int  # ticks until the time limit
    first: int  # tick; the engine is where the tick before it has left it
    last: int  # tick, at most the limit
    row: int  # the next row of the trajectory


class Arrays(NamedTuple):
    """The arrays of the loop, all float64, in which robots come one after another."""

    routes: Array  # (legs, 2) waypoints in order [m]; the loop does not change them
    states: Array  # (robots * STATE_SIZE,) true; then the reports of walkers
    poses: Array  # (robots * STATE_SIZE,) as localized
    legs: Array  # (robots * LEG_SIZE,)
    commands: Array  # (robots * COMMAND_SIZE,) of the controllers
    driven: Array  # (robots * COMMAND_SIZE,) as drives get them; ``commands`` itself without faults
    signals: Array  # of the simulation: true ranges [m], signals of other sensors
    readings: Array  # (channels,) of all sensors, after the filters
    decisions: Array  # (robots + layers,) how many each layer took; first: how many none took
    counts: Array  # (COUNTS, robots)
    clocks: Array  # [s]: since the start, then since the event of each trigger, -1 before it
    triggers: Array  # (triggers, TRIGGER_SIZE), see ``evoros.mission.triggers``
    trajectory: Array  # (rows, columns)


class LoopResult(NamedTuple):
    """How long the mission has lasted, and the rows of its trajectory."""

    ticks: int
    rows: int
    finite: bool  # whether the states were finite to the end


class LoopCall(NamedTuple):
    """The arguments of the loop."""

    inputs: LoopInputs
    agents: Agents
    timing: Timing
    arrays: Arrays


Loop = Callable[[LoopInputs, Agents, Timing, Arrays], LoopResult]

Prepare = Callable[[LoopInputs], tuple[Loop, LoopInputs]]
"""Chooses the loop for the inputs, and adapts these to it."""
