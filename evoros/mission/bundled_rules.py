"""The bundled rules that ``hatch_build.py`` compiles during installation; others compile on use."""

import sys
from collections.abc import Iterator
from importlib import import_module
from inspect import get_annotations, isclass
from types import FunctionType

from evoros.compilation.elementary_arrays import compile_all
from evoros.compilation.named_rules import NamedRule, Nothing
from evoros.compilation.rules import ADVANCE, FILTER, LAYER, OBSERVE, SENSE, try_compile
from evoros.controller.protocol import ESTIMATOR_ARGUMENTS, LAYER_ARGUMENTS
from evoros.files.resources import PACKAGE
from evoros.filter.protocol import FILTER_ARGUMENTS
from evoros.geometry import clearance
from evoros.mission import pipeline
from evoros.mission.compiled_loop import compile_loop
from evoros.robot import self_sight
from evoros.sensor.protocol import SENSOR_ARGUMENTS
from evoros.simulator.engines import planar_rules, planar_sensing

ROOMS = "filter", "sensor", "controller"
KINDS = {
    **dict.fromkeys((FILTER_ARGUMENTS, SENSOR_ARGUMENTS, ESTIMATOR_ARGUMENTS), FILTER),
    LAYER_ARGUMENTS: LAYER,
}
"""Maps the argument names of a part's rule to its signature."""
RULES = (
    (planar_sensing.sense_signals, SENSE),
    (planar_sensing.sense, SENSE),
    (planar_rules.advance, ADVANCE),
    (self_sight.meet_shapes, self_sight.MEET_SHAPES),
    (clearance.fill_summary, clearance.SUMMARY),
    (clearance.fill_clearances, clearance.CLEARANCES),
    (planar_rules.observe, OBSERVE),
    (NamedRule(pipeline.copy_signal, SENSOR_ARGUMENTS), FILTER),
)
"""All other rules with their signatures, ordered by decreasing compile time."""


def compile_share(index: int, shares: int) -> None:
    """Compile share ``index`` of ``shares`` into the cache folder."""
    rules = [*RULES, *((rule, KINDS[rule.arguments]) for rule in list_part_rules())]
    if index == 0:
        compile_loop()
        compile_all()
    for rule, signature in rules[shares - 1 - index :: shares]:
        try_compile(rule, signature)


def list_part_rules() -> Iterator[NamedRule]:
    """List the rules of the bundled filters, sensors and controllers."""
    for room in ROOMS:
        for file in sorted((PACKAGE / room).glob("*.py")):
            module = import_module(f"evoros.{room}.{file.stem}")
            for value in vars(module).values():
                if getattr(value, "__module__", "") == module.__name__:
                    function = getattr(value, "rule", None) if isclass(value) else value
                    if isinstance(function, FunctionType):
                        yield from _recognize(function)


def _recognize(function: FunctionType) -> Iterator[NamedRule]:
    """Yield the function with its signature if it is a rule of a part."""
    kinds = get_annotations(function)
    answer, names = kinds.pop("return", ""), kinds.keys()
    for arguments, signature in KINDS.items():
        fits = answer is bool if signature is LAYER else names & {"values", "pose"}
        if fits and names <= {*arguments}:
            taken = {name: kinds.get(name, Nothing) for name in ("parameters", "memory")}
            yield NamedRule(function, arguments, **taken)
            return


if __name__ == "__main__":
    compile_share(*map(int, sys.argv[1:]))
