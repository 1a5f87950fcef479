"""Lets the compiled mission loop call an engine, which is a live object of Python."""

from collections.abc import Callable
from ctypes import CFUNCTYPE, c_void_p
from typing import Any

import numpy as np

from evoros.base.arrays import Array
from evoros.compilation.interrupts import hold_interrupts
from evoros.compilation.rules import SIMULATION_RULES, call_address, compile_rule
from evoros.mission.loop import Agents, Arrays, Loop, LoopInputs, LoopResult, Timing
from evoros.simulator.protocol import SimulationRules

OBSERVE, SENSE, ADVANCE = range(3)
"""Places of the addresses of the three calls among the parameters of the simulation."""

CALLBACK = CFUNCTYPE(None)


def observe(parameters: Array, memory: Array, state: Array) -> None:
    """Let Python observe the engine."""
    call_address(int(parameters[OBSERVE]))


def sense(parameters: Array, memory: Array, signals: Array) -> None:
    """Let Python sense in the engine."""
    call_address(int(parameters[SENSE]))


def advance(parameters: Array, memory: Array, command: Array, duration: float) -> None:
    """Let Python advance the engine."""
    call_address(int(parameters[ADVANCE]))


ENGINE_RULES = SimulationRules(observe, sense, advance)
"""The rules of motion of every engine: each calls a function of Python that knows its arrays."""


def run_with_engine(
    loop: Loop, inputs: LoopInputs, agents: Agents, timing: Timing, arrays: Arrays
) -> LoopResult:
    """Run a compiled loop with rules of motion that only Python can call.

    Raises:
        Exception: one of these rules raised it, which ends the mission.
    """
    state = inputs.parameters, inputs.memory
    turns = (
        (inputs.observe, *state, arrays.states),
        (inputs.sense, *state, arrays.signals),
        (inputs.advance, *state, arrays.commands, timing.tick),
    )
    errors: list[BaseException] = []
    with hold_interrupts() as deliver:
        callbacks = [_expose(turn, deliver, errors, arrays.states) for turn in turns]
        addresses = [c_void_p.from_buffer_copy(callback).value for callback in callbacks]
        rules = SimulationRules(*map(compile_rule, ENGINE_RULES, SIMULATION_RULES))
        calling = inputs._replace(**rules._asdict(), parameters=np.array(addresses, dtype=float))
        result = loop(calling, agents, timing, arrays)
    if errors:
        raise errors[0]
    return result


def _expose(
    call: tuple[Any, ...], deliver: Callable[[], None], errors: list[BaseException], states: Array
) -> Any:
    """Make a C function of a rule and its arguments.

    An exception cannot pass through compiled code. It is kept, and the states become NaN, which
    ends the mission.
    """
    rule, *arguments = call

    def turn() -> None:
        if not errors:
            try:
                deliver()
                rule(*arguments)
                return
            except BaseException as error:
                errors.append(error)
        states[:] = np.nan

    return CALLBACK(turn)
