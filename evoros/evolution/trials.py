"""The recorded and new trials of a run."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from evoros.base.combining import mean
from evoros.design.design import Design
from evoros.dispatch.dispatcher import Dispatcher
from evoros.evolution.experiment import Experiment
from evoros.evolution.journal import Journal, Watcher
from evoros.evolution.measuring import Measuring
from evoros.fitness.scoring import list_trials
from evoros.mission.mission import Mission, MissionKey
from evoros.mission.outcome import Outcome, Outcomes, judge
from evoros.mission.plan import ACTIVITIES, VALIDATION
from evoros.optimizer.protocol import Individual
from evoros.terminal.activity import announce


@dataclass(frozen=True)
class Trials:
    """Runs the missions that a journal lacks, and scores all of them."""

    experiment: Experiment
    journal: Journal
    watcher: Watcher
    dispatcher: Dispatcher
    measuring: Measuring

    def decode(self, individuals: Sequence[Individual]) -> dict[int, Design]:
        """Return the design of each individual by id."""
        space = self.experiment.space
        return {individual.id: space.decode(individual.genome) for individual in individuals}

    def score(
        self, generation: int, missions: Mapping[int, Sequence[Mission]], purpose: str
    ) -> dict[int, list[float]]:
        """Return the score of each trial of each design.

        Raises:
            InputError: the journal has a mission under other draws, or a score is not finite.
            RunStopped: a mission was lost, and ``lost_missions`` is ``stop``.
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


@dataclass(frozen=True)
class FreshTrials:
    """The trials of a design under draws that no selection uses."""

    trials: list[float] = field(default_factory=list)  # scores of the trials
    # Scores of missions, or of trials if the fitness is not additive; the mean is the same.
    scores: list[float] = field(default_factory=list)
    lowest: float = math.nan  # minimum possible score of the design; NaN without trials
    outcomes: Mapping[str, list[Outcome]] = field(default_factory=dict)  # keyed by world


@dataclass
class Validated:
    """The best of each generation, the champion and its rivals, all under the same fresh draws."""

    trials: Trials
    compared: int = 0  # number of trials at which designs are compared
    fresh: dict[int, FreshTrials] = field(default_factory=dict)
    _generations: dict[int, int] = field(default_factory=dict)  # generation of each individual

    def validate(self, generation: int, individual: Individual) -> None:
        """Validate an individual unless it is validated already or the run does not validate.

        A fitness that is not a mean depends on the number of trials, so it is validated with at
        least the number of trials at which designs were compared.
        """
        experiment = self.trials.experiment
        count = experiment.plan.validation_trials
        if count and experiment.scoring.combine is not mean:
            count = max(count, min(self.compared, experiment.validation.max_trials))
        known = self.fresh.get(individual.id)
        if known is None or len(known.trials) < count:
            self._generations.setdefault(individual.id, generation)
            self.extend(individual, count)

    def extend(self, individual: Individual, count: int) -> FreshTrials:
        """Run and keep ``count`` trials of a validated individual."""
        generation = self._generations[individual.id]
        (design,) = self.trials.decode([individual]).values()
        experiment = self.trials.experiment
        missions = experiment.plan.validation(generation, individual.id, design, count)
        outcomes = self.trials.run(generation, missions, VALIDATION)
        by_world: dict[str, list[Outcome]] = {}
        for mission in missions:
            by_world.setdefault(mission.world, []).append(judge(outcomes[mission.key]))
        scoring, trials = experiment.scoring, list_trials(missions, outcomes)
        self.fresh[individual.id] = FreshTrials(
            scoring.score_trials(missions, outcomes),
            [score for trial in trials for score in scoring.score_missions(trial)],
            scoring.worst(trials[0]) if trials else math.nan,
            by_world,
        )
        return self.fresh[individual.id]

    def list_fitness(self) -> dict[int, float]:
        """Return the validated fitness of individuals with trials."""
        combine = self.trials.experiment.scoring.combine
        return {i: combine(fresh.trials) for i, fresh in self.fresh.items() if fresh.trials}
