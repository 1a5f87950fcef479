"""Limits on the cost of a search, checked after each generation."""

from dataclasses import dataclass, fields
from typing import Annotated

from evoros.base.checks import POSITIVE, Rule, checked, instance_of, null_or_whole

LIMIT = null_or_whole(1)
TIME = Rule("null or a positive number", lambda v: v is None or POSITIVE.holds(v))


@dataclass
class Spent:
    """The cost of a search so far, without validation and final choice."""

    generations: int = 0
    missions: int = 0
    simulated_s: float = 0.0
    processor_s: float = 0.0  # [s], time of missions since the start or last resume
    wall_s: float = 0.0  # [s], since the start or last resume


@dataclass(frozen=True)
@checked
class StopAfter:
    """Ends a search, with a champion, after the generation that reaches a limit; None: no limit."""

    generations: Annotated[int | None, LIMIT] = None
    missions: Annotated[int | None, LIMIT] = None
    simulated_s: Annotated[float | None, TIME] = None
    wall_s: Annotated[float | None, TIME] = None

    def find_reached(self, spent: Spent) -> str:
        """Describe the limits reached; empty if there are none."""
        costs = ((name, getattr(spent, name), getattr(self, name)) for name in LIMITS)
        return ", ".join(
            f"stop_after.{name}: {cost:.12g} of {limit:.12g}"
            for name, cost, limit in costs
            if limit is not None and cost >= limit
        )


LIMITS = tuple(field.name for field in fields(StopAfter))
A_LIMIT = instance_of(StopAfter, "limits (evoros.evolution.stop_after.StopAfter)")
