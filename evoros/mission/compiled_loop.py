"""Missions compiled from start to end, where all rules can be compiled.

Each rule is compiled by itself, with the one signature of its kind, and passed to the compiled loop
as a function of that type: so one compiled loop serves every combination of parts.
"""

from collections.abc import Callable
from functools import cache
from typing import Any, TypeVar

import numpy as np
from numba import njit, types

from evoros.base.arrays import Array
from evoros.base.compilation import (
    A1,
    A2,
    F8,
    FILTER,
    I8,
    LAYER,
    NJIT_OPTIONS,
    RNG,
    SIMULATION_RULES,
    CompiledRule,
    NotCompilable,
    compiling,
    try_compile,
)
from evoros.controller.protocol import StartedLayer
from evoros.mission.loop import (
    Arrays,
    FilterStage,
    LoopInputs,
    LoopResult,
    Timing,
    rule_name,
    run_loop,
)

Part = TypeVar("Part", FilterStage, StartedLayer)

Loop = Callable[..., LoopResult]


def prepare_interpreted(parts: LoopInputs) -> tuple[Loop, LoopInputs]:
    """The interpreted loop with rules as they are."""
    return run_loop, parts


def prepare(parts: LoopInputs) -> tuple[Loop, LoopInputs]:
    """The compiled loop where all rules can be compiled, else the interpreted one.

    That one calls what is compiled of a simulation that is made of rules and of the other parts; a
    live engine's mission stays as it is.
    """
    observe, sense, advance = (
        _compile_if_possible(rule, kind)
        for rule, kind in zip(parts[:3], SIMULATION_RULES, strict=True)
    )
    if not all(isinstance(rule, CompiledRule) for rule in (observe, sense, advance)):
        return run_loop, parts
    filters = tuple(map(_compile_stage, parts.filters))
    localization = tuple(map(_compile_stage, parts.localization))
    layers = tuple(map(_compile_layer, parts.layers))
    rules = [link.rule for link in (*filters, *localization)], [step.rule for step in layers]
    loop: Loop = run_loop
    if all(isinstance(rule, CompiledRule) for chain in rules for rule in chain):
        no_link, no_step = _pads()
        filters, localization = _pad(filters, no_link), _pad(localization, no_link)
        layers = _pad(layers, no_step)
        loop = _loop(len(filters), len(localization), len(layers))
    return loop, LoopInputs(
        observe,
        sense,
        advance,
        parts.parameters,
        parts.memory,
        filters,
        localization,
        layers,
    )


def explain_interpreted(parts: LoopInputs) -> list[str]:
    """What of a simulation that is made of rules is not compiled, and why: a line a rule."""
    rules: list[tuple[Any, Any]] = [*zip(parts[:3], SIMULATION_RULES, strict=True)]
    rules += [(link.rule, FILTER) for link in (*parts.filters, *parts.localization)]
    rules += [(step.rule, LAYER) for step in parts.layers]
    answers = [(rule_name(rule), try_compile(rule, kind)) for rule, kind in rules]
    reasons = {
        f"{name} is not compiled: {reason}": None
        for name, reason in answers
        if isinstance(reason, NotCompilable)
    }
    return list(reasons)


def _compile_stage(link: FilterStage) -> FilterStage:
    return link._replace(rule=_compile_if_possible(link.rule, FILTER))


def _compile_layer(step: StartedLayer) -> StartedLayer:
    return step._replace(rule=_compile_if_possible(step.rule, LAYER))


def _compile_if_possible(rule: Any, kind: Any) -> Any:
    answer = try_compile(rule, kind)
    return answer if isinstance(answer, CompiledRule) else rule


def _pad(parts: tuple[Part, ...], pad: Part) -> tuple[Part, ...]:
    """To the next power of two: few lengths have to be compiled."""
    length = 1
    while length < len(parts):
        length *= 2
    return parts + (pad,) * (length - len(parts))


def _no_filter(constants: Array, kept: Array, rng: Any, values: Array, time: float) -> None:
    """Never called."""


def _no_layer(
    constants: Array,
    kept: Array,
    state: Array,
    leg: Array,
    readings: Array,
    time: float,
    command: Array,
) -> bool:
    """Never decides."""
    return False


@cache
def _pads() -> tuple[FilterStage, StartedLayer]:
    empty = np.zeros(0)
    link = _compile_stage(FilterStage(0, _no_filter, empty, empty, np.random.default_rng(0), empty))
    return link, _compile_layer(StartedLayer(_no_layer, empty, empty))


@cache
def _loop(filters: int, localization: int, layers: int) -> Loop:
    """``run_loop`` for so many links and layers."""
    link = types.NamedTuple((I8, types.FunctionType(FILTER), A1, A1, RNG, A1), FilterStage)
    step = types.NamedTuple((types.FunctionType(LAYER), A1, A1), StartedLayer)
    signature = types.NamedUniTuple(I8, len(LoopResult._fields), LoopResult)(
        *map(types.FunctionType, SIMULATION_RULES),
        A1,
        A1,
        types.UniTuple(link, filters),
        types.UniTuple(link, localization),
        types.UniTuple(step, layers),
        A2,
        F8,
        types.boolean,
        types.NamedTuple((F8, I8, I8, I8, I8), Timing),
        types.NamedTuple((*(A1,) * 6, A2), Arrays),
        A1,
    )
    with compiling() as kept:
        loop = njit(signature, cache=kept, **NJIT_OPTIONS)(run_loop)
    # Without numba's look at the type of every argument, which costs as much as all else that a
    # mission does in Python: parts_of has checked what parts provide.
    entry: Loop = loop.get_compile_result(signature).entry_point
    return entry
