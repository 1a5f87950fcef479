"""The mission loop: observe, sense, filter, decide, advance, until the mission is over.

One plain function of plain arguments: functions, tuples and float64 arrays. Nothing here knows an
engine, a configuration or a file.
"""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import CONTACT, SPEED, STEERING, YAW, Array, X, Y
from evoros.base.errors import InputError
from evoros.controller.protocol import StartedLayer
from evoros.filter.protocol import FilterRule
from evoros.simulator.protocol import (
    AdvanceRule,
    ObserveRule,
    RuleSimulation,
    SenseRule,
    Simulation,
)

RUNNING, COMPLETED, COLLISION, TIME_LIMIT, NOT_FINITE = range(5)
"""How the loop ended."""


class Timing(NamedTuple):
    """Periods in ticks; a tick is the greatest common divisor of all periods."""

    tick: float  # [s]
    sense_every: int
    decide_every: int
    record_every: int
    limit: int  # ticks until the time limit


class FilterStage(NamedTuple):
    """One filter of the chain, started for the sensors of one type."""

    every: int  # ticks; 0: neither this link nor those behind it do anything
    rule: FilterRule
    parameters: Array
    memory: Array
    rng: Generator
    values: Array  # view of the values that it changes


class Arrays(NamedTuple):
    """What the loop works on; all float64."""

    state: Array  # (STATE_SIZE,) true
    pose: Array  # (STATE_SIZE,) as localized
    leg: Array  # (LEG_SIZE,)
    command: Array  # (COMMAND_SIZE,)
    raw: Array  # (sensors,) true ranges [m]
    readings: Array  # (sensors,) after the filters
    trajectory: Array  # (rows, columns + sensors)


class LoopResult(NamedTuple):
    """What the loop counted."""

    ended: int
    ticks: int
    rows: int
    visited: int
    collisions: int
    first_collision: int  # tick, -1: none


class LoopInputs(NamedTuple):
    """The first arguments of ``run_loop``: all rules, with their parameters and memory."""

    observe: ObserveRule
    sense: SenseRule
    advance: AdvanceRule
    parameters: Array  # of the simulation
    memory: Array
    filters: tuple[FilterStage, ...]
    localization: tuple[FilterStage, ...]
    layers: tuple[StartedLayer, ...]


def loop_inputs(
    simulation: Simulation,
    filters: Sequence[FilterStage],
    localization: Sequence[FilterStage],
    layers: Sequence[StartedLayer],
) -> LoopInputs:
    """The parts of a mission; a live engine's methods take the place of rules.

    Raises:
        InputError: parameters or memory of a part are not what rules work on.
    """
    for link in (*filters, *localization):
        _check_arrays(link.rule, link.parameters, link.memory)
    for step in layers:
        _check_arrays(*step)
    chains = tuple(filters), tuple(localization), tuple(layers)
    if isinstance(simulation, RuleSimulation):
        _check_arrays(simulation.rules.advance, simulation.parameters, simulation.memory)
        return LoopInputs(*simulation.rules, simulation.parameters, simulation.memory, *chains)

    def observe(parameters: Array, memory: Array, state: Array) -> None:
        simulation.observe(state)

    def sense(parameters: Array, memory: Array, readings: Array) -> None:
        simulation.sense(readings)

    def advance(parameters: Array, memory: Array, command: Array, duration: float) -> None:
        simulation.advance(command, duration)

    nothing = np.zeros(0)
    return LoopInputs(observe, sense, advance, nothing, nothing, *chains)


def _check_arrays(rule: Callable[..., object], parameters: Array, memory: Array) -> None:
    """Compiled rules take these arrays without another look."""
    for name, array in (("parameters", parameters), ("memory", memory)):
        fits = isinstance(array, np.ndarray) and array.dtype == np.dtype(float) and array.ndim == 1
        if not (fits and array.flags.c_contiguous and array.flags.writeable):
            raise InputError(
                f"{rule_name(rule)}: its {name} must be a contiguous and writeable array of one "
                f"dimension of float64, not {array!r}; make it with np.array(..., dtype=float)"
            )


def rule_name(rule: Callable[..., object]) -> str:
    """For messages: where the rule is defined; of an object that is called, its class."""
    defined = rule if hasattr(rule, "__qualname__") else type(rule)
    return f"{defined.__module__}.{defined.__qualname__}"


def publish(parameters: Array, memory: Array, rng: Generator, values: Array, time: float) -> None:
    """The first link of every chain: a sensor publishes what it measured."""
    values[:] = memory


def run_loop(
    observe: ObserveRule,
    sense: SenseRule,
    advance: AdvanceRule,
    parameters: Array,
    memory: Array,
    filters: tuple[FilterStage, ...],
    localization: tuple[FilterStage, ...],
    layers: tuple[StartedLayer, ...],
    route: Array,  # (legs, 2) waypoints in order [m]
    acceptance: float,  # [m]
    end_on_collision: bool,
    timing: Timing,
    arrays: Arrays,
    modes: Array,  # (layers + 1,) counts the decisions of each layer; the first: of none
) -> LoopResult:
    """Fly one mission; ``arrays.leg`` starts with home as its first point.

    ``parameters`` and ``memory`` are the simulation's. One long function: as one it is compiled
    whole (``evoros.base.compilation``), and read from top to bottom.
    """
    tick, sense_every, decide_every, record_every, limit = timing
    state, pose, leg, command, raw, readings, trajectory = arrays
    legs, reach = len(route), acceptance * acceptance
    visited = collisions = mode = rows = 0
    first_collision, touching, ended = -1, False, RUNNING
    goal_x, goal_y = float(route[0, 0]), float(route[0, 1])
    leg[2] = goal_x
    leg[3] = goal_y
    for k in range(limit + 1):
        time = k * tick
        observe(parameters, memory, state)
        # Plain numbers: an array's own scalars cost several times as much to compute with.
        x, y, yaw, speed = float(state[X]), float(state[Y]), float(state[YAW]), float(state[SPEED])
        if not math.isfinite(x + y + yaw + speed):
            ended = NOT_FINITE
            break
        if (goal_x - x) * (goal_x - x) + (goal_y - y) * (goal_y - y) <= reach:
            visited += 1
            if visited == legs:
                ended = COMPLETED
            else:
                leg[0] = goal_x
                leg[1] = goal_y
                goal_x, goal_y = float(route[visited, 0]), float(route[visited, 1])
                leg[2] = goal_x
                leg[3] = goal_y
        contact = float(state[CONTACT]) > 0.0
        if contact and not touching:
            collisions += 1
            if first_collision < 0:
                first_collision = k
            if end_on_collision and ended == RUNNING:
                ended = COLLISION
        touching = contact
        if k == limit and ended == RUNNING:
            ended = TIME_LIMIT
        if ended == RUNNING:
            if k % sense_every == 0:
                sense(parameters, memory, raw)
                for every, change, constants, kept, rng, values in filters:
                    if every == 0:
                        break
                    if k % every == 0:
                        change(constants, kept, rng, values, time)
            if k % decide_every == 0:
                pose[:] = state
                for every, change, constants, kept, rng, values in localization:
                    if every == 0:
                        break
                    change(constants, kept, rng, values, time)
                mode = 0
                for number, (decide, constants, kept) in enumerate(layers):
                    if decide(constants, kept, pose, leg, readings, time, command):
                        mode = number + 1
                        break
                modes[mode] += 1.0
        if k % record_every == 0 or ended != RUNNING:
            row = trajectory[rows]
            row[0] = time
            row[1] = x
            row[2] = y
            row[3] = yaw
            row[4] = speed
            row[5] = command[STEERING]
            row[6] = mode
            row[7] = visited
            row[8] = 1.0 if contact else 0.0
            row[9:] = readings
            rows += 1
        if ended != RUNNING:
            break
        advance(parameters, memory, command, tick)
    return LoopResult(ended, k, rows, visited, collisions, first_collision)
