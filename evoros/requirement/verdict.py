"""What missions say about a requirement."""

from collections.abc import Mapping
from dataclasses import dataclass

from evoros.mission.outcome import Outcomes

MET, VIOLATED, UNDECIDED = "met", "violated", "undecided"
Trial = Mapping[str, Outcomes]
"""The outcomes of the missions of a trial, by their worlds."""


@dataclass(frozen=True)
class Verdict:
    """What trials say about a requirement, and the mission that is worst for it."""

    result: str  # MET, VIOLATED or UNDECIDED
    trials: int  # that decided it, or all
    value: float  # the mean or the share, over these
    low: float  # bounds, each of which holds with the confidence
    high: float
    confidence: float
    worst: tuple[int, str]  # trial and world of the mission
    case: str = ""  # of failed sensors that the mission meets, if the requirement is about these

    @property
    def text(self) -> str:
        """The numbers behind the result and, unless it is met, the worst mission."""
        text = (
            f"{self.value:.4g} by {self.trials} trials, at least {self.low:.4g} and at most "
            f"{self.high:.4g}, each with confidence {self.confidence:g}"
        )
        if self.result == MET:
            return text
        trial, world = self.worst
        failed = f" with the failures {self.case}" if self.case else ""
        return f"{text}; the worst mission is trial {trial} in {world}{failed}"
