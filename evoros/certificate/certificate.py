"""The certificate of a champion: its fitness and completion rates on fresh draws."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any


@dataclass(frozen=True)
class Rate:
    """The champion's completion rate in a world, with a confidence interval."""

    completed: int
    trials: int
    low: float
    high: float


@dataclass(frozen=True)
class Rival:
    """A design that was validated on the same draws as the champion."""

    design: int
    trials: int
    fitness: float  # fitness in the validation trials
    low: float  # lower end of the fitness interval, simultaneous for all rivals; NaN if unknown
    high: float
    led: bool  # True: best of a generation; False: runner-up in the last generation


@dataclass(frozen=True)
class Finalist:
    """A finalist, and its fitness before and in the final choice."""

    design: int
    fitness: float  # fitness during evolution
    trials: int  # number of trials in the final choice
    final_fitness: float  # fitness in the final choice


@dataclass(frozen=True)
class Certificate:
    """The fitness, completion rates and rivals of a champion on fresh draws."""

    design: int
    recorded_fitness: float  # fitness that led to the champion's selection
    recorded_trials: int
    validated_fitness: float  # NaN if there were no validation trials
    validated_trials: int
    confidence: float  # confidence level of each interval
    fitness_low: float  # lower end of the interval from all fresh draws; NaN if unknown
    fitness_high: float
    precision: float | None  # required half-width of the interval
    precision_trials: int | None  # trials to reach a missed precision; None: not needed or too many
    worlds: Mapping[str, Rate]
    rivals: Sequence[Rival]
    rival_advantage: float  # upper confidence bound on the best rival's advantage; NaN: unknown
    finalists: Sequence[Finalist]  # best first; empty if there was no final choice
    # Completion rates with a failed part other than a sensor, by part and effect (steering: stuck)
    failed_parts: Mapping[str, Rate] = field(default_factory=dict)

    @property
    def text(self) -> str:
        """The text of ``certificate.json``; null for unknown numbers."""
        content = asdict(self)
        if not self.failed_parts:
            del content["failed_parts"]
        return json.dumps(_nulls(content), indent=2) + "\n"

    @property
    def summary(self) -> Mapping[str, Any]:
        """The fields of the certificate in ``status.json``."""
        fields = {
            "best_fitness": self.recorded_fitness,
            "best_validated_fitness": self.validated_fitness,
            "validated_trials": self.validated_trials,
            "fitness_low": self.fitness_low,
            "fitness_high": self.fitness_high,
            "rival_advantage": self.rival_advantage,
        }
        return {name: _nulls(value) for name, value in fields.items()}


def _nulls(value: Any) -> Any:
    """Replace NaN by None, because JSON has no NaN."""
    if isinstance(value, dict):
        return {key: _nulls(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_nulls(item) for item in value]
    return None if isinstance(value, float) and math.isnan(value) else value
