"""The mission loop: observe, sense, filter, decide, advance, until the mission ends.

It is one plain function of functions, numbers and float64 arrays. It knows no engine, configuration
or file.
"""

import math
from typing import NamedTuple

from numpy.random import Generator

from evoros.base.arrays import CONTACT, SPEED, STEERING, YAW, Array, X, Y
from evoros.controller.protocol import StartedLayer
from evoros.filter.protocol import FilterRule
from evoros.simulator.protocol import AdvanceRule, ObserveRule, SenseRule

RUNNING, COMPLETED, COLLISION, TIME_LIMIT, NOT_FINITE = range(5)
"""How the loop ended."""


class FilterStage(NamedTuple):
    """A filter that is started for one mission, for the sensors of one type or the localization."""

    every: int  # ticks between two samples; 0: padding, which ends the pipeline
    rule: FilterRule
    parameters: Array
    memory: Array
    rng: Generator
    values: Array  # a view of the values that the filter changes


class LoopInputs(NamedTuple):
    """The rules of a mission, with their parameters and memory."""

    observe: ObserveRule
    sense: SenseRule
    advance: AdvanceRule
    parameters: Array  # of the simulation
    memory: Array  # of the simulation
    filters: tuple[FilterStage, ...]
    localization: tuple[FilterStage, ...]
    layers: tuple[StartedLayer, ...]


class Goal(NamedTuple):
    """What ends a mission besides its time limit."""

    route: Array  # (legs, 2) waypoints in order [m]
    acceptance: float  # distance [m] from a waypoint at which it is reached
    end_on_collision: bool


class Timing(NamedTuple):
    """Periods in ticks, of which each is the greatest common divisor of all periods."""

    tick: float  # [s]
    sense_every: int
    decide_every: int
    record_every: int
    limit: int  # ticks until the time limit


class Arrays(NamedTuple):
    """The arrays that the loop changes; all float64."""

    state: Array  # (STATE_SIZE,) true
    pose: Array  # (STATE_SIZE,) as localized
    leg: Array  # (LEG_SIZE,)
    command: Array  # (COMMAND_SIZE,)
    ranges: Array  # (beams,) true [m]
    readings: Array  # (channels,) of all sensors, after the filters
    decisions: Array  # (1 + layers,) how many each layer took; first: how many no layer took
    trajectory: Array  # (rows, columns + channels)


class LoopResult(NamedTuple):
    """How the loop ended, and what it counted."""

    ended: int
    ticks: int
    rows: int
    visited: int
    collisions: int
    first_collision: int  # tick; -1: none


def publish(parameters: Array, memory: Array, rng: Generator, values: Array, time: float) -> None:
    """Copy the true ranges, the memory, to the readings; the first stage of every sensor type."""
    values[:] = memory


def run_loop(inputs: LoopInputs, goal: Goal, timing: Timing, arrays: Arrays) -> LoopResult:
    """Run a mission. At the start, ``arrays.leg`` begins at home.

    This is one long function so that numba compiles it as one (``evoros.base.compilation``).
    """
    observe, sense, advance, parameters, memory, filters, localization, layers = inputs
    route, acceptance, end_on_collision = goal
    tick, sense_every, decide_every, record_every, limit = timing
    state, pose, leg, command, ranges, readings, decisions, trajectory = arrays
    legs, reach_squared = len(route), acceptance * acceptance
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
        if (goal_x - x) * (goal_x - x) + (goal_y - y) * (goal_y - y) <= reach_squared:
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
                sense(parameters, memory, ranges)
                for every, change, stage_parameters, stage_memory, rng, values in filters:
                    if every == 0:
                        break
                    if k % every == 0:
                        change(stage_parameters, stage_memory, rng, values, time)
            if k % decide_every == 0:
                pose[:] = state
                for every, change, stage_parameters, stage_memory, rng, values in localization:
                    if every == 0:
                        break
                    change(stage_parameters, stage_memory, rng, values, time)
                mode = 0
                for number, (decide, layer_parameters, layer_memory) in enumerate(layers):
                    if decide(layer_parameters, layer_memory, pose, leg, readings, time, command):
                        mode = number + 1
                        break
                decisions[mode] += 1.0
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
