"""Compiles whole missions, but for the calls of an engine.

Each rule is compiled by itself, with the one signature of its kind, and passed to the compiled loop
as a function of that type. So one compiled loop serves every combination of parts.
"""

from functools import cache, partial
from typing import Any, TypeVar

from numba import types

from evoros.compilation.interrupts import hold_interrupts
from evoros.compilation.machine_code import BORROWING, compile_function, compiling
from evoros.compilation.named_rules import name_rule
from evoros.compilation.rules import (
    A1,
    A2,
    F8,
    FILTER,
    I8,
    LAYER,
    SIMULATION_RULES,
    CompiledRule,
    NotCompilable,
    compile_if_possible,
    interpret_rule,
    try_compile,
)
from evoros.mission import inputs as mission_inputs
from evoros.mission.inputs import FilterStage, LayerStage, Loop, LoopInputs, LoopResult
from evoros.mission.loop import run_loop
from evoros.mission.python_calls import compile_calls, run_with_calls
from evoros.mission.stage_tables import TABLE, tabulate
from evoros.simulator.protocol import SimulationRules

Stage = TypeVar("Stage", FilterStage, LayerStage)


def prepare_interpreted(inputs: LoopInputs) -> tuple[Loop, LoopInputs]:
    """Return the interpreted loop, and the rules with the functions that compiled ones have."""

    def interpret(stages: tuple[Stage, ...]) -> tuple[Stage, ...]:
        return tuple(stage._replace(rule=interpret_rule(stage.rule)) for stage in stages)

    motion = SimulationRules(*map(interpret_rule, inputs[:3]))
    return run_loop, inputs._replace(
        **motion._asdict(),
        filters=interpret(inputs.filters),
        localization=interpret(inputs.localization),
        actuation=interpret(inputs.actuation),
        layers=interpret(inputs.layers),
    )


def prepare(inputs: LoopInputs) -> tuple[Loop, LoopInputs]:
    """Return the compiled loop if all filters can be compiled, else the interpreted loop.

    Rules of motion and of layers need not be compiled: the compiled loop can call those of a live
    engine or controller. The interpreted loop calls the rules that can be compiled.
    """
    motion = SimulationRules(*map(compile_if_possible, inputs[:3], SIMULATION_RULES))
    live = not all(isinstance(rule, CompiledRule) for rule in motion)
    filters = _compile_stages(inputs.filters, FILTER)
    localization = _compile_stages(inputs.localization, FILTER)
    actuation = _compile_stages(inputs.actuation, FILTER)
    layers = _compile_stages(inputs.layers, LAYER)
    loop: Loop = run_loop
    if _are_compiled((*filters, *localization, *actuation)):
        run = _run
        if live or not _are_compiled(layers):
            compile_calls()
            run = run_with_calls
        loop = partial(run, _Entry(_compile_loop()))
    return loop, inputs._replace(
        **({} if live else motion._asdict()),
        filters=filters,
        localization=localization,
        layers=layers,
        actuation=actuation,
    )


def _run(loop: Loop, *arguments: Any) -> LoopResult:
    """Run a compiled loop from its start to its end."""
    with hold_interrupts():
        return loop(*arguments)


def explain_interpreted(inputs: LoopInputs) -> list[str]:
    """Explain in one line a rule why rules of a ``RuleSimulation``'s mission are not compiled."""
    rules: list[tuple[Any, Any]] = [*zip(inputs[:3], SIMULATION_RULES, strict=True)]
    stages = (*inputs.filters, *inputs.localization, *inputs.actuation)
    rules += [(stage.rule, FILTER) for stage in stages]
    rules += [(layer.rule, LAYER) for layer in inputs.layers]
    answers = [(name_rule(rule), try_compile(rule, kind)) for rule, kind in rules]
    reasons = [
        f"{name} is not compiled: {reason}"
        for name, reason in answers
        if isinstance(reason, NotCompilable)
    ]
    return list(dict.fromkeys(reasons))


def _compile_stages(stages: tuple[Stage, ...], kind: Any) -> tuple[Stage, ...]:
    return tuple(stage._replace(rule=compile_if_possible(stage.rule, kind)) for stage in stages)


def _are_compiled(stages: tuple[FilterStage | LayerStage, ...]) -> bool:
    return all(isinstance(stage.rule, CompiledRule) for stage in stages)


class _Entry:
    """Calls the compiled loop with tables of the stages, which it makes once for the same inputs.

    It keeps the inputs, whose addresses the tables have.
    """

    def __init__(self, entry: Any) -> None:
        self._entry = entry
        self._inputs: LoopInputs | None = None

    def __call__(self, inputs: LoopInputs, *arguments: Any) -> LoopResult:
        if inputs is not self._inputs:
            tables: dict[str, Any] = {
                "filters": tabulate(FilterStage, inputs.filters),
                "localization": tabulate(FilterStage, inputs.localization),
                "layers": tabulate(LayerStage, inputs.layers),
                "actuation": tabulate(FilterStage, inputs.actuation),
            }
            self._inputs, self._tabulated = inputs, inputs._replace(**tables)
        result: LoopResult = self._entry(self._tabulated, *arguments)
        return result


@cache
def _compile_loop() -> Any:
    """Compile ``run_loop``."""
    inputs = (*map(types.FunctionType, SIMULATION_RULES), A1, A1, *(TABLE,) * 4, I8)
    truths, integers = types.Array(types.boolean, 1, "C"), types.Array(I8, 1, "C")
    agents = (A1, truths, truths, *(integers,) * 6)
    signature = types.NamedTuple((I8, I8, types.boolean), LoopResult)(
        types.NamedTuple(inputs, LoopInputs),
        types.NamedTuple(agents, mission_inputs.Agents),
        types.NamedTuple((F8, *(I8,) * 5), mission_inputs.Timing),
        types.NamedTuple((A2, *(A1,) * 8, A2, A1, A2, A2), mission_inputs.Arrays),
    )
    with compiling() as cached:
        loop = compile_function(run_loop, signature, cached, **BORROWING)
    # The entry point skips numba's inspection of every argument's type, which takes as long as all
    # other Python code of a mission. ``collect_inputs`` has checked the arrays.
    return loop.get_compile_result(signature).entry_point
