"""Failures that evolve against the designs of a run (competitive coevolution)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated

from numpy.random import Generator

from evoros.base.checks import COUNT, NOT_NEGATIVE, WHOLE, check_order, checked, instance_of, scale
from evoros.base.combining import mean
from evoros.base.errors import InputError
from evoros.failure.protocol import AdaptiveFailure, Case, Failure, Fault, SystematicFailure
from evoros.failure.random import RandomFailure
from evoros.filter.protocol import A_FILTER, Channels, Filter
from evoros.filter.silence import Silence

A_FAILURE = instance_of(Failure, "a failure model (a subclass of evoros.parts.Failure)")


@dataclass(frozen=True)
@checked
class AdversarialFailure(AdaptiveFailure):
    """Cases of sensor failures that evolve from generation to generation.

    During selection, each trial of a generation has one case, the same for all designs. The fitness
    of a case is the score that designs lose in that trial, compared with their other trials. The
    better half of the cases survives, and their mutants replace the rest. ``fame`` trials repeat
    the hardest cases of earlier generations, so that designs do not forget them (Rosin and Belew,
    New methods for competitive coevolution, Evolutionary Computation 5, 1997; parasites against
    sorting networks: Hillis, Physica D 42, 1990). All other missions, such as those for validation,
    use the failures that ``validation`` draws.
    """

    validation: Annotated[Failure, A_FAILURE] = field(default_factory=RandomFailure)
    most: Annotated[int, COUNT] = 1  # maximum number of failed sensors per case
    earliest_s: Annotated[float, NOT_NEGATIVE] = 40.0
    latest_s: Annotated[float, NOT_NEGATIVE] = 80.0
    fame: Annotated[int, WHOLE] = (
        1  # number of trials per generation with old cases, fewer than half
    )
    effect: Annotated[Filter, A_FILTER] = field(default_factory=Silence)  # applied to the readings

    def __post_init__(self) -> None:
        check_order(self, "earliest_s", "latest_s")
        if isinstance(self.validation, SystematicFailure | AdaptiveFailure):
            raise InputError(
                f"failure.validation: must be drawn for each mission, unlike "
                f"{type(self.validation).__name__}; choose another model, for example random"
            )

    @property
    def parts(self) -> Sequence[str]:
        return self.validation.parts

    def draw(self, channels: Channels, rng: Generator) -> tuple[Fault, ...]:
        return self.validation.draw(channels, rng)

    def start(self, sensors: int, trials: int, rng: Generator) -> "EvolvingCases":
        return EvolvingCases(self, sensors, trials, rng)


class EvolvingCases:
    """The cases of a run, one per trial of a generation."""

    def __init__(
        self, model: AdversarialFailure, sensors: int, trials: int, rng: Generator
    ) -> None:
        self._model, self._sensors, self._rng = model, sensors, rng
        self._famous: list[Case] = []
        self._replayed = min(model.fame, (trials - 1) // 2)
        self._evolving = [self._create() for _ in range(trials - self._replayed)]

    def list_cases(self) -> list[Case]:
        """Return the cases of the next generation, evolving cases first."""
        famous = self._famous or self._evolving  # none is famous in the first generation
        chosen = [famous[self._choose(len(famous))] for _ in range(self._replayed)]
        return [*self._evolving, *chosen]

    def tell(self, scores: Mapping[int, Mapping[int, float]]) -> None:
        """Evolve the cases from scores keyed by design and case index."""
        harm: list[list[float]] = [[] for _ in self._evolving]
        for by_place in scores.values():
            usual = mean(list(by_place.values())) if by_place else 0.0
            for place, score in by_place.items():
                if place < len(harm):
                    harm[place].append(usual - score)
        fitness = [mean(losses) if losses else -float("inf") for losses in harm]
        order = sorted(range(len(harm)), key=lambda place: -fitness[place])
        ranked = [self._evolving[place] for place in order]
        if ranked[0] not in self._famous:
            self._famous.append(ranked[0])
        kept = ranked[: (len(ranked) + 1) // 2]
        mutants = [self._mutate(kept[i % len(kept)]) for i in range(len(ranked) - len(kept))]
        self._evolving = [*kept, *mutants]

    def _create(self) -> Case:
        failures: dict[int, float] = {}
        for _ in range(1 + self._choose(self._model.most)):
            if self._sensors:
                failures[self._choose(self._sensors)] = self._draw_time()
        return Case.of(failures.items())

    def _mutate(self, case: Case) -> Case:
        failures = dict(zip(case.sensors, case.times_s, strict=True))
        if not failures:
            return case
        sensor = case.sensors[self._choose(len(failures))]
        others = sorted(set(range(self._sensors)) - failures.keys())
        kind = self._choose(4)
        if kind == 0 and others and len(failures) < self._model.most:
            failures[others[self._choose(len(others))]] = self._draw_time()
        elif kind == 1 and len(failures) > 1:
            del failures[sensor]
        elif kind == 2 and others:
            failures[others[self._choose(len(others))]] = failures.pop(sensor)
        else:
            failures[sensor] = self._draw_time()
        return Case.of(failures.items())

    def _draw_time(self) -> float:
        share = float(self._rng.random())
        return round(scale(share, self._model.earliest_s, self._model.latest_s), 1)

    def _choose(self, count: int) -> int:
        return int(self._rng.random() * count)
