"""Names of fitness functions in figures, from titles, units or class names."""

import math
import re
from dataclasses import dataclass

from evoros.fitness.protocol import Fitness

UNBOUNDED = (-math.inf, math.inf)
_WORDS = re.compile(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+")


@dataclass(frozen=True)
class FitnessName:
    """The axis label of a fitness function or another measure, with its bounds."""

    title: str = "fitness"
    unit: str = ""  # empty if dimensionless
    bounds: tuple[float, ...] = ()  # minimum and maximum; empty if unknown

    @property
    def label(self) -> str:
        """The label of an axis: the title, with the unit in brackets."""
        return f"{self.title} [{self.unit}]" if self.unit else self.title


def bound_fitness(fitness: Fitness, worlds: int) -> tuple[float, ...]:
    """Return the minimum and maximum of the fitness over ``worlds``; empty if unknown."""
    return tuple(map(float, fitness.bounds(worlds)))


def name_fitness(fitness: Fitness) -> FitnessName:
    """Return a fitness function's title (by default, the class name in words) and unit."""
    title = fitness.title.strip() or f"fitness ({_split_words(type(fitness).__name__)})"
    return FitnessName(title, fitness.unit.strip())


def _split_words(name: str) -> str:
    """Split a class name into words, in lower case unless they are abbreviations."""
    words = _WORDS.findall(name) or [name]
    return " ".join(word if len(word) > 1 and word.isupper() else word.lower() for word in words)
