"""What a run keeps of its individuals' scores: numbers of all, and the best for a final choice."""

from collections.abc import Iterable, Mapping, Sequence

from evoros.evolution.final_choice import FinalChoice
from evoros.evolution.number_log import NumberLog
from evoros.optimizer.protocol import Individual


class Ledger:
    """The scores of a run's individuals so far, by their id."""

    def __init__(self, measures: int, final_choice: FinalChoice | None) -> None:
        self._final_choice = final_choice
        self._screened = NumberLog(1)  # the score of a trial in the run's own simulator
        self._told = NumberLog(1 + measures)  # as the search was told: fitness and measures
        self._shown = NumberLog(2)  # the generation and the number of trials before it
        self.finalists: dict[int, Individual] = {}
        """The best so far, and those whose fitness may change; empty without a final choice."""

    def add_screened(self, scores: Mapping[int, Sequence[float]]) -> None:
        """Add the scores of further trials."""
        for number, of_trials in scores.items():
            for score in of_trials:
                self._screened.add(number, [score])

    def find_screened(self, individuals: Iterable[int]) -> dict[int, list[float]]:
        """Return the scores of all trials of each of these individuals."""
        found = self._screened.find(individuals)
        return {number: [score for (score,) in rows] for number, rows in found.items()}

    def add_told(self, individual: int, fitness: float, measures: Sequence[float]) -> None:
        """Add what the search is told of an individual."""
        self._told.add(individual, [fitness, *measures])

    def find_told(self, individuals: Iterable[int]) -> dict[int, list[float]]:
        """Return the fitness and the measures of individuals, as the search was told last."""
        return self._told.find_last(individuals)

    def find_fitness(self, individuals: Iterable[int]) -> dict[int, float]:
        """Return the fitness of individuals, as the search was told last."""
        return {number: row[0] for number, row in self.find_told(individuals).items()}

    def show(self, individual: int, generation: int, earlier: int) -> None:
        """Note which trials an individual shows as a champion: those of this generation.

        ``earlier`` is the number of its trials in generations before.
        """
        self._shown.add(individual, (generation, earlier))

    def find_shown(self, individual: int) -> tuple[int, int]:
        """Return the generation and the number of earlier trials as ``show`` noted them last."""
        generation, earlier = self._shown.find_last([individual])[individual]
        return int(generation), int(earlier)

    def keep_finalists(self, alive: Iterable[Individual]) -> None:
        """Keep the individuals that a final choice may need; ``alive`` ones may yet change.

        The fitness of all others is final. So one that is not among the best of these now never
        will be.
        """
        if self._final_choice is None:
            return
        living = {individual.id: individual for individual in alive}
        self.finalists |= living
        ended = self.find_fitness(self.finalists.keys() - living.keys())
        kept = living.keys() | set(self._final_choice.find_finalists(ended))
        self.finalists = {number: own for number, own in self.finalists.items() if number in kept}
