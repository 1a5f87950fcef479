"""The certificate of a champion: its fitness and completion rates, measured on fresh draws."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any


@dataclass(frozen=True)
class Rate:
    """The champion's completion rate in a world, with the rate's interval."""

    completed: int
    trials: int
    low: float
    high: float


@dataclass(frozen=True)
class Rival:
    """Another design that was validated on the champion's draws."""

    design: int
    trials: int
    fitness: float  # fitness in these trials
    low: float  # lower end of the fitness interval, simultaneous for all rivals; NaN if unknown
    high: float
    led: bool  # True: best of a generation; False: runner-up of the last generation


@dataclass(frozen=True)
class Finalist:
    """A finalist, with its fitness before and in the final choice."""

    design: int
    fitness: float  # fitness during evolution
    trials: int  # number of trials in the final choice
    final_fitness: float  # fitness in the final choice


@dataclass(frozen=True)
class Certificate:
    """The champion's fitness, success and rivals on fresh draws."""

    design: int
    recorded_fitness: float  # the fitness by which the champion was selected
    recorded_trials: int
    validated_fitness: float  # NaN without validation trials
    validated_trials: int
    confidence: float  # confidence level of each interval
    fitness_low: float  # interval over all fresh draws; NaN if unknown
    fitness_high: float
    precision: float | None  # required half-width of the interval
    # Estimated number of trials that would reach a missed precision; None if the precision was
    # reached or is far out of reach.
    precision_trials: int | None
    worlds: Mapping[str, Rate]
    rivals: Sequence[Rival]
    # Upper confidence bound on the best rival's advantage; NaN if unknown.
    rival_advantage: float
    finalists: Sequence[Finalist]  # best first; empty without a final choice
    # Completion rates of missions in which a part other than a sensor failed, by part and effect
    # (``steering: stuck``).
    failed_parts: Mapping[str, Rate] = field(default_factory=dict)

    @property
    def text(self) -> str:
        """The content of ``certificate.json``; unknown numbers are null."""
        content = asdict(self)
        if not self.failed_parts:
            del content["failed_parts"]
        return json.dumps(_nulls(content), indent=2) + "\n"

    @property
    def summary(self) -> Mapping[str, Any]:
        """The certificate's fields in ``status.json``."""
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
    """Replace NaN with None, because JSON has no NaN."""
    if isinstance(value, dict):
        return {key: _nulls(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_nulls(item) for item in value]
    return None if isinstance(value, float) and math.isnan(value) else value
