"""Collects the inputs of the mission loop from the parts that are started for a mission."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from evoros.base.arrays import NO_VALUES, Array
from evoros.base.errors import InputError
from evoros.compilation.named_rules import name_rule
from evoros.mission.loop import FilterStage, LayerStage, LoopInputs
from evoros.simulator.protocol import RuleSimulation, Simulation


class Stages(NamedTuple):
    """The stages of one robot."""

    filters: Sequence[FilterStage]
    localization: Sequence[FilterStage]
    layers: Sequence[LayerStage]


def collect_inputs(simulation: Simulation, robots: Sequence[Stages]) -> LoopInputs:
    """Collect the rules of a mission; the methods of a live engine take the place of rules.

    Raises:
        InputError: the parameters or the memory of a simulation are not as rules need them.
    """
    filters = _join(robot.filters for robot in robots)
    localization = _join(robot.localization for robot in robots)
    layers = tuple(layer for robot in robots for layer in robot.layers)
    stages: tuple[Any, ...] = filters, localization, layers, len(robots)
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


def _join(pipelines: Iterable[Sequence[FilterStage]]) -> tuple[FilterStage, ...]:
    """Return the stages of all robots, each with the number of its robot."""
    return tuple(
        stage._replace(agent=number)
        for number, pipeline in enumerate(pipelines)
        for stage in pipeline
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
