"""The final choice of the champion among a run's best designs, on fresh draws."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

from evoros.allocation.protocol import Allocation
from evoros.base.checks import COUNT, Rule, ask, checked, instance_of, is_whole

AN_ALLOCATION = instance_of(Allocation, "an allocation (a subclass of evoros.parts.Allocation)")


@dataclass(frozen=True)
@checked
class FinalChoice:
    """Runs the best designs on fresh draws after the last generation, as allocated by ``method``.

    The champion is the best of the designs that remain in the last round (best-arm identification).
    Earlier scores are ignored, because the finalists were selected by them.
    """

    method: Annotated[Allocation, AN_ALLOCATION]
    finalists: Annotated[int, COUNT] = 20  # number of best designs of the whole run

    def find_finalists(self, fitness: Mapping[int, float]) -> list[int]:
        """Return the ids of the fittest designs, best first; ties are sorted by id."""
        return sorted(fitness, key=lambda i: (-fitness[i], i))[: self.finalists]


def find_finalists(final: FinalChoice, fitness: Mapping[int, float]) -> list[int]:
    """Return the finalists of a final choice, after checking them."""

    if not fitness:
        return []

    def are_designs(value: object) -> bool:
        known = isinstance(value, list) and all(is_whole(one) and one in fitness for one in value)
        return known and 0 < len(value) == len(set(value))  # type: ignore[arg-type, call-overload]

    rule = Rule(f"a list of distinct ids of the {len(fitness)} designs", are_designs)
    found: list[int] = ask("final_choice", final.find_finalists, rule, fitness)
    return found


A_FINAL_CHOICE = instance_of(
    FinalChoice, "a final choice (evoros.certificate.final_choice.FinalChoice)"
)
