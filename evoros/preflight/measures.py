"""Tries the measures that depend on the design alone, before a run."""

import math
from collections.abc import Iterator

from evoros.base.errors import InputError
from evoros.base.rng import generator
from evoros.evolution.experiment import Experiment
from evoros.evolution.measuring import equip_robots, list_measures
from evoros.measure.protocol import DESCRIPTORS, Evaluated, Measure

DESIGNS = 32


def check_measures(experiment: Experiment) -> Iterator[str]:
    """Yield a warning for each objective that is equal for all designs that were tried.

    Raises:
        InputError: a measure is not a finite number, or a descriptor is equal for all.
    """
    measures = list_measures(experiment).items()
    named = {key: measure for key, measure in measures if measure.of_design}
    if not named or not experiment.space.size:
        return
    tried = list(_try_designs(experiment))
    for key, measure in named.items():
        values = {_compute(key, measure, evaluated) for evaluated in tried}
        if len(values) > 1:
            continue
        problem = f"differ between designs, and is {values.pop():g} for all {DESIGNS} tried"
        if key.startswith(DESCRIPTORS):
            raise InputError(
                f"{key}: must {problem}; choose another one, or a design in which it evolves"
            )
        yield f"{key}: should {problem}; remove it (~{key}), or choose another design"


def _try_designs(experiment: Experiment) -> Iterator[Evaluated]:
    space, rng = experiment.space, generator("preflight", "measures")
    for genome in rng.random((DESIGNS, space.size)):
        design = space.decode(genome)
        robots = equip_robots(experiment.scenario, design)
        yield Evaluated(design, robots, (), math.nan, experiment.scoring.score_trial)


def _compute(key: str, measure: Measure, evaluated: Evaluated) -> float:
    try:
        value = float(measure.compute(evaluated))
    except InputError as error:
        raise InputError(f"{key}.{error}") from None
    if not math.isfinite(value):
        raise InputError(
            f"{key}: must be a finite number, not {value}; correct {type(measure).__name__}"
        )
    return value
