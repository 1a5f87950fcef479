"""The name of a fitness in figures: its title and unit, or the name of its class."""

import math
import re
from dataclasses import dataclass

from evoros.fitness.protocol import Fitness

UNBOUNDED = (-math.inf, math.inf)
_WORDS = re.compile(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+")


@dataclass(frozen=True)
class FitnessName:
    """The words for the axes of figures, of a fitness or of another measure."""

    title: str = "fitness"
    unit: str = ""  # empty if it has none
    bounds: tuple[float, ...] = ()  # minimum and maximum; empty if they are unknown

    @property
    def label(self) -> str:
        """The label of an axis: the title, and the unit in brackets."""
        return f"{self.title} [{self.unit}]" if self.unit else self.title


def bound_fitness(fitness: Fitness, worlds: int) -> tuple[float, ...]:
    """Return the ``bounds(worlds)`` that a fitness states, for so many worlds; empty if none."""
    if not hasattr(fitness, "bounds"):
        return ()
    return tuple(map(float, fitness.bounds(worlds)))


def name_fitness(fitness: Fitness) -> FitnessName:
    """Return the ``title`` and ``unit`` that a fitness states.

    Without a title, the words of the name of its class are added to "fitness".
    """
    title, unit = (str(getattr(fitness, name, "")).strip() for name in ("title", "unit"))
    return FitnessName(title or f"fitness ({_split_words(type(fitness).__name__)})", unit)


def _split_words(name: str) -> str:
    """Return the words of a class's name, in small letters unless they are abbreviations."""
    words = _WORDS.findall(name) or [name]
    return " ".join(word if len(word) > 1 and word.isupper() else word.lower() for word in words)
