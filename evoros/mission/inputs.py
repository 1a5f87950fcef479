"""The stages, numbers and arrays of the mission loop."""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple, TypeAlias, TypeVar

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from evoros.base.arrays import Array
from evoros.simulator.protocol import AdvanceRule, ObserveRule, SenseRule

Integers: TypeAlias = NDArray[np.int64]
Truths: TypeAlias = NDArray[np.bool_]

RUNNING, COMPLETED, COLLISION, TIME_LIMIT = range(4)
"""Endings of a robot's mission; RUNNING: the mission ended first."""

VISITED, COLLISIONS, FIRST_COLLISION, TOUCHING, DECIDED, ENDED, END_TICK, END_ROW = range(8)
"""Rows of ``Arrays.counts``: waypoints reached; number of contacts and tick of the first (-1:
none); 1 in contact; mode of the last decision; ending, its tick and its trajectory row."""
COUNTS = 8


class FilterStage(NamedTuple):
    """A rule of a sensor, a filter or a localization that fills or changes values."""

    every: int  # ticks between two samples
    rule: Callable[[Array, Array, Generator, Array, Array, float], None]
    parameters: Array
    memory: Array
    rng: Generator
    source: Array  # view of the values that it reads
    values: Array  # view of the values that it changes
    agent: int = 0  # index of its robot
    clock: int = 0  # index in ``Arrays.clocks`` of the rule's time


class LayerStage(NamedTuple):
    """A layer of a controller."""

    rule: Callable[[Array, Array, Array, Array, Array, float, Array], bool]
    parameters: Array
    memory: Array


STAGES: Mapping[str, type[FilterStage | LayerStage]] = {
    "filters": FilterStage,
    "localization": FilterStage,
    "layers": LayerStage,
    "actuation": FilterStage,
}
"""The type of stage by field of ``LoopInputs``."""

S = TypeVar("S", FilterStage, LayerStage)


def get_stage(kind: type[S], stages: Sequence[S], place: int) -> S:
    """Return a stage; compiled code reads it from a table (``evoros.mission.compiled_loop``)."""
    return stages[place]


class LoopInputs(NamedTuple):
    """The rules of a mission with their parameters and memory, robot by robot."""

    observe: ObserveRule
    sense: SenseRule
    advance: AdvanceRule
    parameters: Array  # the simulation's
    memory: Array  # the simulation's
    filters: tuple[FilterStage, ...]
    localization: tuple[FilterStage, ...]
    layers: tuple[LayerStage, ...]
    actuation: tuple[FilterStage, ...]  # stages between controllers and drives
    robots: int


class Agents(NamedTuple):
    """The settings of each robot, and the indices of its values in the arrays."""

    acceptance: Array  # distance [m] from a waypoint at which it is reached
    end_on_collision: Truths
    awaited: Truths  # true if the mission waits for the robot's end
    sense_every: Integers  # [ticks]
    decide_every: Integers  # [ticks]
    # The start of each robot's part, and the end of the last part.
    routes: Integers  # rows of ``Arrays.routes``
    layers: Integers  # indices in ``LoopInputs.layers``
    readings: Integers  # indices in ``Arrays.readings``
    estimates: Integers  # columns of estimated poses in a trajectory


class Timing(NamedTuple):
    """Periods in ticks, and the part of the mission to run."""

    tick: float  # [s], common divisor of all periods
    record_every: int
    limit: int  # ticks until the time limit
    first: int  # first tick to run
    last: int  # last tick to run, at most the limit
    row: int  # next row of the trajectory


class Arrays(NamedTuple):
    """The float64 arrays of the loop, robot by robot."""

    routes: Array  # (legs, 2) waypoints in order [m], constant
    states: Array  # (robots * STATE_SIZE,) true states; then the reports of walkers
    poses: Array  # (robots * STATE_SIZE,) localized states
    legs: Array  # (robots * LEG_SIZE,)
    commands: Array  # (robots * COMMAND_SIZE,) controller output
    driven: Array  # (robots * COMMAND_SIZE,) drive input; ``commands`` itself without faults
    signals: Array  # simulation output: true ranges [m], signals of other sensors
    readings: Array  # (channels,) filtered readings of all sensors
    decisions: Array  # (robots + layers,) number by layer, after the number taken by none
    counts: Array  # (COUNTS, robots)
    clocks: Array  # [s] since the start, then since each trigger's event (-1: not yet)
    triggers: Array  # (triggers, TRIGGER_SIZE), see ``evoros.mission.triggers``
    trajectory: Array  # (rows, columns)


class LoopResult(NamedTuple):
    """The number of ticks run and trajectory rows written."""

    ticks: int
    rows: int
    finite: bool  # true if all states were finite


class LoopCall(NamedTuple):
    """The arguments of the loop."""

    inputs: LoopInputs
    agents: Agents
    timing: Timing
    arrays: Arrays


Loop = Callable[[LoopInputs, Agents, Timing, Arrays], LoopResult]

Prepare = Callable[[LoopInputs], tuple[Loop, LoopInputs]]
"""Chooses the loop for the inputs, and adapts them to it."""
