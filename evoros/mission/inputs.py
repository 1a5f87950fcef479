"""The inputs of the mission loop, and calls from compiled code to Python."""

from collections.abc import Callable, Mapping, Sequence
from ctypes import CFUNCTYPE, c_void_p
from functools import partial
from typing import Any, NamedTuple, TypeAlias, TypeVar

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from evoros.base.arrays import COMMAND_SIZE, LEG_SIZE, STATE_SIZE, Array
from evoros.compilation.interrupts import Release, hold_interrupts
from evoros.compilation.rules import (
    LAYER,
    SIMULATION_RULES,
    CompiledRule,
    call_address,
    compile_rule,
)
from evoros.simulator.protocol import AdvanceRule, ObserveRule, SenseRule, SimulationRules

Integers: TypeAlias = NDArray[np.int64]
Truths: TypeAlias = NDArray[np.bool_]

RUNNING, COMPLETED, COLLISION, TIME_LIMIT = range(4)  # ending of each robot; RUNNING if it has none

VISITED, COLLISIONS, FIRST_COLLISION, TOUCHING, DECIDED, ENDED, END_TICK, END_ROW = range(8)
"""Rows of ``Arrays.counts``.

In this order: the number of waypoints reached; the number of collisions, and the tick of the first
(-1: none); 1 while in contact; the mode of the last decision; the ending, with its tick and
trajectory row.
"""
COUNTS = 8


class FilterStage(NamedTuple):
    """A rule of a sensor, filter or localization, with the arrays that it reads and writes."""

    every: int  # number of ticks between two samples
    rule: Callable[[Array, Array, Generator, Array, Array, float], None]
    parameters: Array
    memory: Array
    rng: Generator
    source: Array  # view of the input values
    values: Array  # view of the output values
    agent: int = 0  # index of the robot
    clock: int = 0  # index of the rule's time in ``Arrays.clocks``


class LayerStage(NamedTuple):
    """The rule of a controller layer, with its parameters and memory."""

    rule: Callable[[Array, Array, Array, Array, Array, float, Array], bool]
    parameters: Array
    memory: Array


STAGES: Mapping[str, type[FilterStage | LayerStage]] = {
    "filters": FilterStage,
    "localization": FilterStage,
    "layers": LayerStage,
    "actuation": FilterStage,
}
"""The stage type of each field of ``LoopInputs`` that holds stages."""

S = TypeVar("S", FilterStage, LayerStage)


def get_stage(kind: type[S], stages: Sequence[S], place: int) -> S:
    """Return the stage at an index. Compiled code reads it from a table (see ``compiled_loop``)."""
    return stages[place]


class LoopInputs(NamedTuple):
    """The rules of a mission with their parameters and memory, in the order of the robots."""

    observe: ObserveRule
    sense: SenseRule
    advance: AdvanceRule
    parameters: Array  # simulation parameters
    memory: Array  # simulation memory
    filters: tuple[FilterStage, ...]
    localization: tuple[FilterStage, ...]
    layers: tuple[LayerStage, ...]
    actuation: tuple[FilterStage, ...]  # stages between the controllers and the drives
    robots: int


class Agents(NamedTuple):
    """The settings of each robot, and the indices of each robot's values in the arrays."""

    acceptance: Array  # (robots,) [m], distance at which a waypoint counts as reached
    end_on_collision: Truths
    awaited: Truths  # (robots,) true if the mission continues until this robot has ended
    sense_every: Integers  # [ticks]
    decide_every: Integers  # [ticks]
    # Index of each robot's first entry in an array, followed by the end of the last robot's
    # entries:
    routes: Integers  # rows of ``Arrays.routes``
    layers: Integers  # indices in ``LoopInputs.layers``
    readings: Integers  # indices in ``Arrays.readings``
    estimates: Integers  # trajectory columns of the estimated poses


class Timing(NamedTuple):
    """The periods of the loop in ticks, and the ticks to run."""

    tick: float  # [s], largest common divisor of all periods
    record_every: int
    limit: int  # number of ticks until the time limit
    first: int  # first tick to run
    last: int  # last tick to run, at most ``limit``
    row: int  # index of the next trajectory row


class Arrays(NamedTuple):
    """The float64 arrays of the loop, ordered by robot."""

    routes: Array  # (legs, 2) [m], waypoints in driving order, constant
    states: Array  # (robots * STATE_SIZE,) true states, then walkers' reports
    poses: Array  # (robots * STATE_SIZE,) states as localized
    legs: Array  # (robots * LEG_SIZE,)
    commands: Array  # (robots * COMMAND_SIZE,) output of the controllers
    driven: Array  # (robots * COMMAND_SIZE,) drive input; ``commands`` itself without faults
    signals: Array  # output of the simulation: true ranges [m] and signals of other sensors
    readings: Array  # (channels,) readings of all sensors after filtering
    decisions: Array  # (robots + layers,) number of decisions by no layer and by each layer
    counts: Array  # (COUNTS, robots)
    clocks: Array  # time [s] since the start, then since each trigger's event (-1: not yet)
    triggers: Array  # (triggers, TRIGGER_SIZE), see ``evoros.mission.triggers``
    trajectory: Array  # (rows, columns)


class LoopResult(NamedTuple):
    """The last tick run, and the number of trajectory rows written."""

    ticks: int
    rows: int
    finite: bool  # true if all states are finite


class LoopCall(NamedTuple):
    """The arguments of the loop."""

    inputs: LoopInputs
    agents: Agents
    timing: Timing
    arrays: Arrays


Loop = Callable[[LoopInputs, Agents, Timing, Arrays], LoopResult]

Run = Callable[[LoopCall], LoopResult]  # runs the loop with the given arguments


OBSERVE, SENSE, ADVANCE = range(3)  # indices of an engine's call addresses in the parameters
TIME, ANSWER = range(2)  # indices in the memory of a layer written in Python

CALLBACK = CFUNCTYPE(None)
Expose: TypeAlias = Callable[[Callable[[], object]], float]  # address of a function in C


def observe(parameters: Array, memory: Array, state: Array) -> None:
    """Call the Python function that observes the engine."""
    call_address(int(parameters[OBSERVE]))


def sense(parameters: Array, memory: Array, signals: Array) -> None:
    """Call the Python function that reads the engine's sensors."""
    call_address(int(parameters[SENSE]))


def advance(parameters: Array, memory: Array, command: Array, duration: float) -> None:
    """Call the Python function that advances the engine."""
    call_address(int(parameters[ADVANCE]))


ENGINE_RULES = SimulationRules(observe, sense, advance)
"""Motion rules for any engine; each calls a Python function that is bound to the loop's arrays."""


def decide(
    parameters: Array,
    memory: Array,
    state: Array,
    leg: Array,
    readings: Array,
    time: float,
    command: Array,
) -> bool:
    """Call the Python function of a layer, which is bound to the layer's arrays."""
    memory[TIME] = time
    call_address(int(parameters[0]))
    return bool(memory[ANSWER] != 0.0)


def compile_calls() -> tuple[SimulationRules, CompiledRule]:
    """Compile the rules that call Python for an engine and for a layer."""
    rules = SimulationRules(*map(compile_rule, ENGINE_RULES, SIMULATION_RULES))
    return rules, compile_rule(decide, LAYER)


def run_with_calls(
    loop: Loop, inputs: LoopInputs, agents: Agents, timing: Timing, arrays: Arrays
) -> LoopResult:
    """Run a compiled loop with interpreted motion rules or layers; raise their first exception."""
    errors: list[BaseException] = []
    callbacks: list[Any] = []
    with hold_interrupts() as release:

        def expose(function: Callable[[], object]) -> float:
            callback = _make_callback(function, release, errors, arrays.counts[ENDED])
            callbacks.append(callback)
            return float(c_void_p.from_buffer_copy(callback).value or 0)

        motion, call_layer = compile_calls()
        calling = inputs._replace(layers=_expose_layers(inputs, agents, arrays, expose, call_layer))
        if not isinstance(inputs.observe, CompiledRule):
            addresses = _expose_engine(inputs, timing, arrays, expose)
            calling = calling._replace(**motion._asdict(), parameters=addresses)
        result = loop(calling, agents, timing, arrays)
    if errors:
        raise errors[0]
    return result


def _make_callback(
    function: Callable[[], object], release: Release, errors: list[BaseException], ended: Array
) -> Any:
    """Wrap a Python function as a C function."""

    # Exceptions cannot pass through compiled code, so the mission is stopped before the next step.
    def call() -> None:
        if not errors:
            try:
                release(function)
            except BaseException as error:
                errors.append(error)
                ended[:] = COLLISION

    return CALLBACK(call)


def _expose_engine(inputs: LoopInputs, timing: Timing, arrays: Arrays, expose: Expose) -> Array:
    state = inputs.parameters, inputs.memory
    turns = (
        partial(inputs.observe, *state, arrays.states),
        partial(inputs.sense, *state, arrays.signals),
        partial(inputs.advance, *state, arrays.driven, timing.tick),
    )
    return np.array([expose(turn) for turn in turns])


def _expose_layers(
    inputs: LoopInputs, agents: Agents, arrays: Arrays, expose: Expose, call_layer: CompiledRule
) -> tuple[LayerStage, ...]:
    layers = list(inputs.layers)
    for i in range(inputs.robots):
        for place in range(agents.layers[i], agents.layers[i + 1]):
            if not isinstance(layers[place].rule, CompiledRule):
                memory = np.zeros(2)
                turn = _bind_layer(layers[place], agents, arrays, i, memory)
                layers[place] = LayerStage(call_layer, np.array([expose(turn)]), memory)
    return tuple(layers)


def _bind_layer(
    layer: LayerStage, agents: Agents, arrays: Arrays, i: int, memory: Array
) -> Callable[[], None]:
    rule, parameters, kept = layer
    state = arrays.poses[i * STATE_SIZE : (i + 1) * STATE_SIZE]
    leg = arrays.legs[i * LEG_SIZE : (i + 1) * LEG_SIZE]
    readings = arrays.readings[agents.readings[i] : agents.readings[i + 1]]
    command = arrays.commands[i * COMMAND_SIZE : (i + 1) * COMMAND_SIZE]

    def turn() -> None:
        time = float(memory[TIME])
        memory[ANSWER] = rule(parameters, kept, state, leg, readings, time, command)

    return turn
