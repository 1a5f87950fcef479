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

        Raises:
            InputError, RunStopped: see ``Trials.score``.
        """
        experiment, fitness = self.trials.experiment, contest.fitness()
        if experiment.confirmation is None:
            return fitness

        def confirm(best: Iterable[int]) -> dict[int, float]:
            missions = {}
            for number in best:
                trials, earlier = range(len(contest.scores[number])), len(contest.earlier[number])
                missions[number] = experiment.plan.confirmation(
                    *(generation, number, designs[number], trials, earlier, cases)
                )
                if number not in self.scores:
                    self.ledger.show(number, generation, earlier)
            for number, scores in self.trials.score(generation, missions, CONFIRMATION).items():
                self.scores.setdefault(number, []).extend(scores)
                self.screened.setdefault(number, []).extend(contest.scores[number])
            return {number: experiment.combine(self.scores[number]) for number in missions}

        fitness |= experiment.confirmation.confirm_best(contest.fitness(), confirm)
        known = self.scores.keys() & contest.scores.keys()
        return fitness | {number: experiment.combine(self.scores[number]) for number in known}

    def list_losses(self) -> dict[int, float]:
        """Return by how much the confirmed fitness of each is below the screened one."""
        combine = self.trials.experiment.combine
        return {
            number: combine(self.screened[number]) - combine(scores)
            for number, scores in self.scores.items()
        }
