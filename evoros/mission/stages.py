"""The stages between engines, controllers and drives, and the inputs of the loop that runs them."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from evoros.base.arrays import NO_VALUES, Array
from evoros.base.errors import InputError
from evoros.compilation.named_rules import name_rule
from evoros.mission.inputs import FilterStage, LayerStage, LoopInputs
from evoros.mission.part_faults import Actuation
from evoros.simulator.protocol import RuleSimulation, Simulation


class Stages(NamedTuple):
    """The stages of one robot."""

    filters: Sequence[FilterStage]
    localization: Sequence[FilterStage]
    layers: Sequence[LayerStage]
    actuation: Actuation | None = None  # None: drives get the commands themselves


def collect_inputs(simulation: Simulation, robots: Sequence[Stages]) -> LoopInputs:
    """Collect the rules of a mission; the methods of a live engine take the place of rules.

    Raises:
        InputError: the parameters or the memory of a simulation are not as rules need them.
    """
    filters, localization = (
        _number([getattr(robot, kind) for robot in robots]) for kind in ("filters", "localization")
    )
    actuation = collect_actuation(robots)
    layers = tuple(layer for robot in robots for layer in robot.layers)
    stages: tuple[Any, ...] = filters, localization, layers, actuation, len(robots)
    if isinstance(simulation, RuleSimulation):
        arrays = simulation.parameters, simulation.memory
        _check_arrays(simulation.rules.advance, *arrays)
        return LoopInputs(*simulation.rules, *arrays, *stages)

    def observe(parameters: Array, memory: Array, state: Array) -> None:
        simulation.observe(state)

    def sense(parameters: Array, memory: Array, signals: Array) -> None:
        simulation.sense(signals)

    def advance(parameters: Array, memory: Array, command: Array, duration: float) -> None:
        simulation.advance(command, duration)

    return LoopInputs(observe, sense, advance, NO_VALUES, NO_VALUES, *stages)


def collect_actuation(robots: Sequence[Stages]) -> tuple[FilterStage, ...]:
    """Collect the stages between controllers and drives."""
    return _number([robot.actuation.stages if robot.actuation else [] for robot in robots])


def _number(robots: Sequence[Sequence[FilterStage]]) -> tuple[FilterStage, ...]:
    return tuple(
        stage._replace(agent=index) for index, stages in enumerate(robots) for stage in stages
    )


def _check_arrays(rule: Callable[..., object], parameters: Array, memory: Array) -> None:
    """Check the arrays of a rule, because compiled code does not."""
    for name, array in (("parameters", parameters), ("memory", memory)):
        fits = isinstance(array, np.ndarray) and array.dtype == np.dtype(float) and array.ndim == 1
        if not (fits and array.flags.c_contiguous and array.flags.writeable):
            raise InputError(
                f"{name_rule(rule)}: its {name} must be a contiguous and writeable array of one "
                f"dimension of float64, not {array!r}; make it with np.array(..., dtype=float)"
            )
