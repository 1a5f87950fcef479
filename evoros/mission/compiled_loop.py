"""Compiles whole missions whose rules can all be compiled.

Each rule is compiled by itself, with the one signature of its kind, and passed to the compiled loop
as a function of that type. So one compiled loop serves every combination of parts.
"""

from collections.abc import Callable
from functools import cache
from typing import Any, TypeVar

import numpy as np
from numba import njit, types

from evoros.base.arrays import NO_MEMORY, NO_PARAMETERS, Array
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
    Goal,
    LoopInputs,
    LoopResult,
    Timing,
    run_loop,
)
from evoros.mission.loop_inputs import name_rule
from evoros.simulator.protocol import SimulationRules

Stage = TypeVar("Stage", FilterStage, StartedLayer)

Loop = Callable[[LoopInputs, Goal, Timing, Arrays], LoopResult]


def prepare_interpreted(inputs: LoopInputs) -> tuple[Loop, LoopInputs]:
    """Return the interpreted loop, and the rules as they are."""
    return run_loop, inputs


def prepare(inputs: LoopInputs) -> tuple[Loop, LoopInputs]:
    """Return the compiled loop if all rules can be compiled, else the interpreted loop.

    The interpreted loop calls those rules of a ``RuleSimulation``'s mission that can be compiled.
    The mission of a live engine is not changed.
    """
    motion = SimulationRules(*map(_compile_if_possible, inputs[:3], SIMULATION_RULES))
    if not all(isinstance(rule, CompiledRule) for rule in motion):
        return run_loop, inputs
    filters, localization = (
        tuple(_compile_stage(stage, FILTER) for stage in stages)
        for stages in (inputs.filters, inputs.localization)
    )
    layers = tuple(_compile_stage(layer, LAYER) for layer in inputs.layers)
    loop: Loop = run_loop
    if all(map(_is_compiled, filters + localization)) and all(map(_is_compiled, layers)):
        no_filter, no_layer = _padding()
        filters, localization = _pad(filters, no_filter), _pad(localization, no_filter)
        layers = _pad(layers, no_layer)
        loop = _compile_loop(len(filters), len(localization), len(layers))
    arrays = inputs.parameters, inputs.memory
    return loop, LoopInputs(*motion, *arrays, filters, localization, layers)


def explain_interpreted(inputs: LoopInputs) -> list[str]:
    """Explain in one line a rule why rules of a ``RuleSimulation``'s mission are not compiled."""
    rules: list[tuple[Any, Any]] = [*zip(inputs[:3], SIMULATION_RULES, strict=True)]
    rules += [(stage.rule, FILTER) for stage in (*inputs.filters, *inputs.localization)]
    rules += [(layer.rule, LAYER) for layer in inputs.layers]
    answers = [(name_rule(rule), try_compile(rule, kind)) for rule, kind in rules]
    reasons = {
        f"{name} is not compiled: {reason}": None
        for name, reason in answers
        if isinstance(reason, NotCompilable)
    }
    return list(reasons)


def _compile_stage(stage: Stage, kind: Any) -> Stage:
    return stage._replace(rule=_compile_if_possible(stage.rule, kind))


def _compile_if_possible(rule: Any, kind: Any) -> Any:
    answer = try_compile(rule, kind)
    return answer if isinstance(answer, CompiledRule) else rule


def _is_compiled(stage: FilterStage | StartedLayer) -> bool:
    return isinstance(stage.rule, CompiledRule)


def _pad(stages: tuple[Stage, ...], padding: Stage) -> tuple[Stage, ...]:
    """Extend stages to the next power of two, so that few lengths have to be compiled."""
    length = 1
    while length < len(stages):
        length *= 2
    return stages + (padding,) * (length - len(stages))


def _no_filter(parameters: Array, memory: Array, rng: Any, values: Array, time: float) -> None:
    """Pads a pipeline; never called."""


def _no_layer(
    parameters: Array,
    memory: Array,
    state: Array,
    leg: Array,
    readings: Array,
    time: float,
    command: Array,
) -> bool:
    """Never decide."""
    return False


@cache
def _padding() -> tuple[FilterStage, StartedLayer]:
    rng, nothing = np.random.default_rng(0), np.zeros(0)
    stage = FilterStage(0, _no_filter, NO_PARAMETERS, NO_MEMORY, rng, nothing)
    layer = StartedLayer(_no_layer, NO_PARAMETERS, NO_MEMORY)
    return _compile_stage(stage, FILTER), _compile_stage(layer, LAYER)


@cache
def _compile_loop(filters: int, localization: int, layers: int) -> Loop:
    """Compile ``run_loop`` for these numbers of filters and layers."""
    stage = types.NamedTuple((I8, types.FunctionType(FILTER), A1, A1, RNG, A1), FilterStage)
    layer = types.NamedTuple((types.FunctionType(LAYER), A1, A1), StartedLayer)
    rules = map(types.FunctionType, SIMULATION_RULES)
    pipelines = (
        types.UniTuple(stage, filters),
        types.UniTuple(stage, localization),
        types.UniTuple(layer, layers),
    )
    signature = types.NamedUniTuple(I8, len(LoopResult._fields), LoopResult)(
        types.NamedTuple((*rules, A1, A1, *pipelines), LoopInputs),
        types.NamedTuple((A2, F8, types.boolean), Goal),
        types.NamedTuple((F8, I8, I8, I8, I8), Timing),
        types.NamedTuple((*(A1,) * 7, A2), Arrays),
    )
    with compiling() as cached:
        loop = njit(signature, cache=cached, **NJIT_OPTIONS)(run_loop)
    # The entry point skips numba's inspection of every argument's type, which takes as long as all
    # other Python code of a mission. ``collect_inputs`` has checked the arrays.
    entry: Loop = loop.get_compile_result(signature).entry_point
    return entry
