"""The certificate of a champion, on fresh draws."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any


@dataclass(frozen=True)
class Rate:
    """How often the champion has completed a world, with its interval."""

    completed: int
    trials: int
    low: float
    high: float


@dataclass(frozen=True)
class Rival:
    """Another design that has met the champion's draws."""

    design: int
    trials: int  # that both have met
    fitness: float  # over these
    chance: float  # that it is better than the champion; NaN below two trials
    led: bool  # whether it was the best of a generation; otherwise it is a next best of the end


@dataclass(frozen=True)
class Finalist:
    """A design of the final choice, and its scores there."""

    design: int
    fitness: float  # by which the evolution knew it
    trials: int  # in the final choice
    final_fitness: float  # over these


@dataclass(frozen=True)
class Certificate:
    """The champion's fitness, success and rivals on draws that did not select it."""

    design: int
    recorded_fitness: float  # by which it was chosen
    recorded_trials: int
    validated_fitness: float  # NaN without validation trials
    validated_trials: int
    confidence: float  # of each interval
    fitness_low: float  # over all fresh draws; NaN if they have no interval
    fitness_high: float
    precision: float | None  # the half-width that was asked for
    worlds: Mapping[str, Rate]
    rivals: Sequence[Rival]
    chance_of_better: float  # that at least one of the rivals is better; NaN without any
    finalists: Sequence[Finalist]  # the best first; empty without a final choice
    # How often missions were completed in which a part other than a sensor failed, by the part and
    # the effect, for example ``steering: stuck``.
    failed_parts: Mapping[str, Rate] = field(default_factory=dict)

    @property
    def text(self) -> str:
        """The content of ``certificate.json``; numbers that are not known are null."""
        content = asdict(self)
        if not self.failed_parts:
            del content["failed_parts"]
        return json.dumps(_nulls(content), indent=2) + "\n"

    @property
    def summary(self) -> Mapping[str, Any]:
        """The fields of ``status.json``."""
        fields = {
            "best_fitness": self.recorded_fitness,
            "best_validated_fitness": self.validated_fitness,
            "validated_trials": self.validated_trials,
            "fitness_low": self.fitness_low,
            "fitness_high": self.fitness_high,
            "chance_of_better": self.chance_of_better,
        }
        return {name: _nulls(value) for name, value in fields.items()}


def _nulls(value: Any) -> Any:
    """Replace NaN by None, which JSON has."""
    if isinstance(value, dict):
        return {key: _nulls(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_nulls(item) for item in value]
    return None if isinstance(value, float) and math.isnan(value) else value
