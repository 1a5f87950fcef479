"""What the evolution reports: generations, and to whom."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import fmean
from typing import Protocol

from evoros.mission.mission import Mission
from evoros.mission.outcome import Outcome
from evoros.optimizer.protocol import Candidate


@dataclass(frozen=True)
class Generation:
    """What is known when a generation is over."""

    number: int
    candidates: Sequence[Candidate]
    best: Candidate
    validated: float | None  # of the best; None without validation trials
    mean: float  # fitness of the candidate pool
    losses: Mapping[int, float]  # screened less confirmed fitness, of all confirmed so far, by id

    @property
    def loss(self) -> float | None:
        """Of the best; None where it was not confirmed."""
        return self.losses.get(self.best.individual.id)

    @property
    def mean_loss(self) -> float | None:
        """Of all that were confirmed so far; None without a confirmation."""
        return fmean(self.losses.values()) if self.losses else None

    @property
    def standing(self) -> str:
        """Best fitness, recorded and validated, mean, and loss, for messages."""
        validated = "" if self.validated is None else f", validated {self.validated:.3f}"
        loss = "" if self.loss is None else f", loss {self.loss:.3f}"
        return f"best {self.best.fitness:.3f}{validated}{loss}, mean {self.mean:.3f}"


class Observer(Protocol):
    """Watches a run; nothing depends on it."""

    def begin(self, generation: int, missions: int, known: int) -> None:
        """So many missions are wanted next, of which so many are on disk already."""
        ...

    def mission(self, mission: Mission, outcome: Outcome) -> None:
        """A mission was flown and is on disk."""
        ...

    def generation(self, generation: Generation) -> None:
        """A generation is over and on disk."""
        ...
