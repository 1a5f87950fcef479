"""Scores under draws that no selection uses, the same for every design."""

from dataclasses import dataclass, field

from evoros.evolution.trials import Trials
from evoros.mission.outcome import Outcome, judge
from evoros.mission.plan import VALIDATION
from evoros.optimizer.protocol import Individual


@dataclass
class Validated:
    """The validated scores of the best of generations, and of a champion and its rivals."""

    trials: Trials
    scores: dict[int, list[float]] = field(default_factory=dict)
    _generations: dict[int, int] = field(default_factory=dict)  # of their missions

    def validate(self, generation: int, individual: Individual) -> None:
        """Validate an individual, unless it has been validated or the run does not validate."""
        if individual.id not in self.scores:
            self._generations[individual.id] = generation
            count = self.trials.experiment.plan.validation_trials
            self.scores[individual.id], _ = self.extend(individual, count)

    def extend(
        self, individual: Individual, count: int
    ) -> tuple[list[float], dict[str, list[Outcome]]]:
        """Return the scores of so many trials of a validated one, and the outcomes by world."""
        generation = self._generations[individual.id]
        (design,) = self.trials.decode([individual]).values()
        experiment = self.trials.experiment
        missions = experiment.plan.validation(generation, individual.id, design, count)
        outcomes = self.trials.run(generation, missions, VALIDATION)
        by_world: dict[str, list[Outcome]] = {}
        for mission in missions:
            by_world.setdefault(mission.world, []).append(judge(outcomes[mission.key]))
        return experiment.scoring.score_trials(missions, outcomes), by_world

    def list_fitness(self) -> dict[int, float]:
        """Return the validated fitness of individuals that have any trials."""
        combine = self.trials.experiment.combine
        return {i: combine(scores) for i, scores in self.scores.items() if scores}
