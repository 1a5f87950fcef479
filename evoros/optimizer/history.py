"""What a search has asked for so far, and what it was told."""

from collections.abc import Iterable, Mapping, Sequence

from evoros.base.arrays import Array
from evoros.optimizer.protocol import Candidate, Individual, Score, check_scores


class History:
    """The individuals of a search and their scores, by their id."""

    def __init__(self) -> None:
        self.asked: list[Individual] = []  # in this generation
        self.individuals: dict[int, Individual] = {}
        self.scores: dict[int, Score] = {}

    def ask(
        self, genomes: Sequence[Array], operator: str, parents: Sequence[tuple[int, ...]] = ()
    ) -> list[Individual]:
        """Create the individuals of the next generation; a genome (size,) is a copy within 0..1."""
        first = len(self.individuals)
        self.asked = [
            Individual(
                first + place,
                _freeze(genome),
                parents[place] if parents else (),
                operator,
            )
            for place, genome in enumerate(genomes)
        ]
        self.individuals |= {individual.id: individual for individual in self.asked}
        return self.asked

    def tell(self, scores: Mapping[int, Score]) -> bool:
        """Note scores; return whether any of earlier generations has changed.

        Raises:
            InputError: a score is missing, or has NaN; nothing is noted.
        """
        check_scores(scores, self.asked)
        known = {number: self.scores[number] for number in scores if number in self.scores}
        self.scores |= {number: scores[number] for number in sorted(scores)}
        return any(scores[number] != score for number, score in known.items())

    @property
    def fitness(self) -> list[float]:
        """The fitness of those asked for, in their order."""
        return [float(self.scores[individual.id].fitness) for individual in self.asked]

    @property
    def best(self) -> Individual | None:
        """The fittest so far; of equals, the first."""
        if not self.scores:
            return None
        number = max(self.scores, key=lambda number: (self.scores[number].fitness, -number))
        return self.individuals[number]

    def tabulate(self, shown: Iterable[int], survivors: Iterable[int]) -> list[Candidate]:
        """Return the rows of those asked for, and of others that are to be ``shown``.

        Earlier ones come first. ``survived`` is 1 for ``survivors`` and 0 for the others.
        """
        kept = set(survivors)
        asked = {individual.id for individual in self.asked}
        earlier = sorted(set(shown) - asked)
        return [
            Candidate(
                self.individuals[number],
                self.individuals[number].operator if number in asked else "survivor",
                float(self.scores[number].fitness),
                int(number in kept),
            )
            for number in (*earlier, *sorted(asked))
        ]


def _freeze(genome: Array) -> Array:
    """Return a write-protected copy within the unit cube, because an individual never changes."""
    frozen = genome.clip(0.0, 1.0).astype(float)
    frozen.flags.writeable = False
    return frozen
