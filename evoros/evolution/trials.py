"""The trials of a run: those that are recorded, and those that run now."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from evoros.design.design import Design
from evoros.dispatch.dispatcher import Dispatcher
from evoros.evolution.experiment import Experiment
from evoros.evolution.journal import Journal, Observer
from evoros.evolution.measuring import Measuring
from evoros.mission.mission import Mission, MissionKey
from evoros.mission.outcome import Outcomes
from evoros.mission.plan import ACTIVITIES
from evoros.optimizer.protocol import Individual
from evoros.terminal.activity import announce


@dataclass(frozen=True)
class Trials:
    """Runs the missions that a journal does not have, and scores them."""

    experiment: Experiment
    journal: Journal
    observer: Observer
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
        self.observer.begin(generation, len(needed), sum(map(journal.has, needed)))
        scenario = self.experiment.scenario_for(purpose)
        with announce(ACTIVITIES[purpose]):
            self.dispatcher.run_missing(scenario, needed, journal, self.observer.mission)
        recorded = ((mission.key, journal.find(mission)) for mission in needed)
        return {key: outcome for key, outcome in recorded if outcome is not None}
