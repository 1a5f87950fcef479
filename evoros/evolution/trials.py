"""The trials of a run: those that are recorded, and those that run now."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from evoros.design.design import Design
from evoros.dispatch.dispatcher import Dispatcher
from evoros.evolution.experiment import Experiment
from evoros.evolution.journal import Journal, Watcher
from evoros.evolution.measuring import Measuring
from evoros.mission.mission import Mission, MissionKey
from evoros.mission.outcome import Outcome, Outcomes, judge
from evoros.mission.plan import ACTIVITIES, VALIDATION
from evoros.optimizer.protocol import Individual
from evoros.terminal.activity import announce


@dataclass(frozen=True)
class Trials:
    """Runs the missions that a journal does not have, and scores them."""

    experiment: Experiment
    journal: Journal
    watcher: Watcher
    dispatcher: Dispatcher
    measuring: Measuring

    def decode(self, individuals: Sequence[Individual]) -> dict[int, Design]:
        """Return the design of each individual, by its id."""
        space = self.experiment.space
        return {individual.id: space.decode(individual.genome) for individual in individuals}

    def score(
        self, generation: int, missions: Mapping[int, Sequence[Mission]], purpose: str
    ) -> dict[int, list[float]]:
        """Return the score of each trial of each design.

        Raises:
            InputError: the journal has a mission under other draws, or a score is not finite.
            RunStopped: a mission was lost, and the experiment stops at that.
        """
        needed = [mission for of_design in missions.values() for mission in of_design]
        outcomes = self.run(generation, needed, purpose)
        self.measuring.note(purpose, missions, outcomes)
        return {
            design: self.experiment.scoring.score_trials(of_design, outcomes)
            for design, of_design in missions.items()
        }

    def run(
        self, generation: int, needed: Sequence[Mission], purpose: str
    ) -> dict[MissionKey, Outcomes]:
        """Return the outcomes of missions of one generation."""
        journal = self.journal
        if not needed:
            return {}
        self.watcher.begin(generation, len(needed), sum(map(journal.has, needed)))
        scenario = self.experiment.scenario_for(purpose)
        with announce(ACTIVITIES[purpose]):
            self.dispatcher.run_missing(scenario, needed, journal, self.watcher.mission)
        recorded = ((mission.key, journal.find(mission)) for mission in needed)
        return {key: outcome for key, outcome in recorded if outcome is not None}


@dataclass
class Validated:
    """Scores under draws that no selection uses, the same for every design.

    They are of the best of each generation, and of a champion and its rivals.
    """

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
