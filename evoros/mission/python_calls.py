"""Python calls from the compiled mission loop, to live engines and interpreted layers."""

from collections.abc import Callable
from ctypes import CFUNCTYPE, c_void_p
from functools import partial
from typing import Any, TypeAlias

import numpy as np

from evoros.base.arrays import COMMAND_SIZE, LEG_SIZE, STATE_SIZE, Array
from evoros.compilation.interrupts import Release, hold_interrupts
from evoros.compilation.rules import (
    LAYER,
    SIMULATION_RULES,
    CompiledRule,
    call_address,
    compile_rule,
)
from evoros.mission.inputs import (
    COLLISION,
    ENDED,
    Agents,
    Arrays,
    LayerStage,
    Loop,
    LoopInputs,
    LoopResult,
    Timing,
)
from evoros.simulator.protocol import SimulationRules

OBSERVE, SENSE, ADVANCE = range(3)
"""Indices of the call addresses among the parameters of the simulation."""
TIME, ANSWER = range(2)
"""Indices in the memory of a layer that calls Python; its only parameter is the call address."""

CALLBACK = CFUNCTYPE(None)
Expose: TypeAlias = Callable[[Callable[[], object]], float]
"""Wraps a Python function as a C function, and returns its address."""


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
"""The motion rules of every live engine; each calls a Python function bound to its arrays."""


def decide(
    parameters: Array,
    memory: Array,
    state: Array,
    leg: Array,
    readings: Array,
    time: float,
    command: Array,
) -> bool:
    """Call the Python function that decides for a layer; it is bound to the layer's arrays."""
    memory[TIME] = time
    call_address(int(parameters[0]))
    return bool(memory[ANSWER] != 0.0)


def compile_calls() -> tuple[SimulationRules, CompiledRule]:
    """Return the compiled rules that call an engine, and the rule that calls a layer."""
    rules = SimulationRules(*map(compile_rule, ENGINE_RULES, SIMULATION_RULES))
    return rules, compile_rule(decide, LAYER)


def run_with_calls(
    loop: Loop, inputs: LoopInputs, agents: Agents, timing: Timing, arrays: Arrays
) -> LoopResult:
    """Run a compiled loop with interpreted rules of motion or of layers.

    Raises:
        Exception: one of these rules raised it, which ends the mission.
    """
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
    """Wrap a Python function as a C function.

    An exception cannot pass through compiled code. It is stored, and every robot is ended, so that
    the mission ends before its next step.
    """

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
    """Replace interpreted layers by the compiled rule that calls them."""
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
    """Return a function that calls a layer of robot ``i`` as the loop would."""
    rule, parameters, kept = layer
    state = arrays.poses[i * STATE_SIZE : (i + 1) * STATE_SIZE]
    leg = arrays.legs[i * LEG_SIZE : (i + 1) * LEG_SIZE]
    readings = arrays.readings[agents.readings[i] : agents.readings[i + 1]]
    command = arrays.commands[i * COMMAND_SIZE : (i + 1) * COMMAND_SIZE]

    def turn() -> None:
        time = float(memory[TIME])
        memory[ANSWER] = rule(parameters, kept, state, leg, readings, time, command)

    return turn
