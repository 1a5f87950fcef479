"""The choice of a champion among the best designs of a whole run, on fresh draws."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

from evoros.allocation.protocol import Allocation
from evoros.base.checks import COUNT, checked, instance_of

AN_ALLOCATION = instance_of(Allocation, "an allocation (most_trials and next_round)")


@dataclass(frozen=True)
@checked
class FinalChoice:
    """After the last generation, ``method`` gives the best designs trials on draws of their own.

    Best-arm identification: the champion is the best of the designs that stayed in the contest
    longest. The draws serve no other purpose. Scores of the evolution, which selected the
    finalists, do not count.
    """

    method: Annotated[Allocation, AN_ALLOCATION]
    finalists: Annotated[int, COUNT] = 20  # designs with the best fitness of the whole run

    def find_finalists(self, fitness: Mapping[int, float]) -> list[int]:
        """Return the ids of the fittest designs, the best first; of equals the older first."""
        return sorted(fitness, key=lambda i: (-fitness[i], i))[: self.finalists]


A_FINAL_CHOICE = instance_of(
    FinalChoice, "a final choice (evoros.certificate.final_choice.FinalChoice)"
)
