"""The individuals that a search has asked for, and their scores."""

from collections.abc import Iterable, Mapping, Sequence

from evoros.base.arrays import Array
from evoros.optimizer.protocol import Candidate, Individual, Score, check_scores


class History:
    """The individuals of a search and their scores, by their id."""

    def __init__(self) -> None:
        self.asked: list[Individual] = []  # in this generation
        self.individuals: dict[int, Individual] = {}
        self.scores: dict[int, Score] = {}

    def ask(self, genomes: Sequence[Array], operator: str) -> None:
        """Create the individuals of the next generation from genomes (size,), clipped to 0..1."""
        start = len(self.individuals)
        self.asked = [
            Individual(index, freeze(genome), (), operator)
            for index, genome in enumerate(genomes, start)
        ]
        self.individuals |= {individual.id: individual for individual in self.asked}

    def tell(self, scores: Mapping[int, Score]) -> bool:
        """Note scores; return whether any of earlier generations has changed.

        Raises:
            InputError: a score is missing, or has NaN; nothing is noted.
        """
        check_scores(scores, self.asked)
        known = {index: self.scores[index] for index in scores if index in self.scores}
        self.scores |= {index: scores[index] for index in sorted(scores)}
        return any(scores[index] != score for index, score in known.items())

    @property
    def fitness(self) -> list[float]:
        """The fitness of this generation, in the order of ``asked``."""
        return [float(self.scores[individual.id].fitness) for individual in self.asked]

    def rank(self, ids: Iterable[int]) -> list[Individual]:
        """Return individuals, the fittest first; of equals, the older first."""
        ranked = sorted(ids, key=lambda index: (-self.scores[index].fitness, index))
        return [self.individuals[index] for index in ranked]

    def tabulate(self, shown: Iterable[int], survivors: Iterable[int]) -> list[Candidate]:
        """Return the rows of earlier ``shown`` individuals, then of this generation.

        ``survived`` is 1 for ``survivors`` and 0 for the others.
        """
        kept = set(survivors)
        asked = {individual.id for individual in self.asked}
        earlier = sorted(set(shown) - asked)
        return [
            Candidate(
                self.individuals[index],
                self.individuals[index].operator if index in asked else "survivor",
                float(self.scores[index].fitness),
                int(index in kept),
            )
            for index in (*earlier, *sorted(asked))
        ]


def freeze(genome: Array) -> Array:
    """Return a write-protected copy within the unit cube, because an individual never changes."""
    frozen = genome.clip(0.0, 1.0).astype(float)
    frozen.flags.writeable = False
    return frozen
