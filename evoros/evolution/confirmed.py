"""Scores in the confirming simulator, of the best designs of each generation."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from evoros.design.design import Design
from evoros.evolution.contest import Contest
from evoros.evolution.ledger import Ledger
from evoros.evolution.trials import Trials
from evoros.failure.case import Case
from evoros.mission.plan import CONFIRMATION


@dataclass
class Confirmed:
    """The scores of confirmed trials, and of the same trials in the run's own simulator."""

    trials: Trials
    ledger: Ledger
    scores: dict[int, list[float]] = field(default_factory=dict)
    screened: dict[int, list[float]] = field(default_factory=dict)

    def confirm_best(
        self,
        generation: int,
        designs: Mapping[int, Design],
        contest: Contest,
        cases: Sequence[Case],
    ) -> dict[int, float]:
        """Repeat the trials of the best designs; return the fitness of all, by id.

        It is the confirmed fitness of those that have ever been confirmed.
        """
        experiment, fitness = self.trials.experiment, contest.fitness()
        if experiment.confirmation is None:
            return fitness

        def confirm(best: Iterable[int]) -> dict[int, float]:
            missions = {}
            for i in best:
                trials, earlier = range(len(contest.scores[i])), len(contest.earlier[i])
                missions[i] = experiment.plan.confirmation(
                    generation, i, designs[i], trials, earlier, cases
                )
                if i not in self.scores:
                    self.ledger.show(i, generation, earlier)
            for i, scores in self.trials.score(generation, missions, CONFIRMATION).items():
                self.scores.setdefault(i, []).extend(scores)
                self.screened.setdefault(i, []).extend(contest.scores[i])
            return {i: experiment.combine(self.scores[i]) for i in missions}

        fitness |= experiment.confirmation.confirm_best(contest.fitness(), confirm)
        known = self.scores.keys() & contest.scores.keys()
        return fitness | {i: experiment.combine(self.scores[i]) for i in known}

    def list_losses(self) -> dict[int, float]:
        """Return the screened minus the confirmed fitness of each confirmed design, by id."""
        combine = self.trials.experiment.combine
        return {i: combine(self.screened[i]) - combine(scores) for i, scores in self.scores.items()}
