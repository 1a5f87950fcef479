"""Names of fitness functions in figures."""

import math
import re
from dataclasses import dataclass

from evoros.fitness.protocol import Fitness

UNBOUNDED = (-math.inf, math.inf)
_WORDS = re.compile(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+")


@dataclass(frozen=True)
class FitnessName:
    """The axis label and the bounds of a fitness function or another measure."""

    title: str = "fitness"
    unit: str = ""  # empty if dimensionless
    bounds: tuple[float, ...] = ()  # minimum and maximum; empty if unknown

    @property
    def label(self) -> str:
        """The axis label: the title, and the unit in brackets."""
        return f"{self.title} [{self.unit}]" if self.unit else self.title


def bound_fitness(fitness: Fitness, worlds: int) -> tuple[float, ...]:
    """Return the minimum and maximum fitness for ``worlds``; empty if unknown."""
    return tuple(map(float, fitness.bounds(worlds)))


def name_fitness(fitness: Fitness) -> FitnessName:
    """Return a fitness function's unit and its title, by default the class name in words."""
    title = fitness.title.strip() or f"fitness ({_split_words(type(fitness).__name__)})"
    return FitnessName(title, fitness.unit.strip())


def _split_words(name: str) -> str:
    """Split a class name into words; only abbreviations keep upper case."""
    words = _WORDS.findall(name) or [name]
    return " ".join(word if len(word) > 1 and word.isupper() else word.lower() for word in words)
