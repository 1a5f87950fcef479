"""Scores the individuals of a run by missions that are recorded or run now."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from evoros.design.design import Design
from evoros.evolution.dispatch import Dispatcher
from evoros.evolution.experiment import Experiment
from evoros.evolution.journal import Generation, Journal, Observer
from evoros.fitness.scoring import compute_fitness
from evoros.mission.plan import CONFIRMATION, SELECTION, VALIDATION
from evoros.optimizer.protocol import Candidate, Individual, Score


@dataclass
class Scores:
    """The fitness of the individuals of a run so far, by their id."""

    experiment: Experiment
    journal: Journal
    observer: Observer
    dispatcher: Dispatcher
    screened: dict[int, float] = field(default_factory=dict)  # in the run's own simulator
    confirmed: dict[int, float] = field(default_factory=dict)  # in the confirming simulator
    validated: dict[int, float] = field(default_factory=dict)  # under draws of their own
    born: dict[int, int] = field(default_factory=dict)  # the generation in which each was new

    def evaluate(self, generation: int, individuals: Sequence[Individual]) -> dict[int, Score]:
        """Return the score of each new individual; its fitness is confirmed if it was confirmed.

        Raises:
            InputError: the journal has a mission under other draws, or a score is not finite.
            RunStopped: a mission was lost, and the experiment stops at that.
        """
        confirmation = self.experiment.confirmation
        designs = self._decode(individuals)
        screened = self._score(generation, designs, SELECTION)

        def confirm(best: Iterable[int]) -> dict[int, float]:
            chosen = {number: designs[number] for number in best}
            return self._score(generation, chosen, CONFIRMATION)

        confirmed = confirmation.confirm_best(screened, confirm) if confirmation else {}
        self.born.update(dict.fromkeys(designs, generation))
        self.screened.update(screened)
        self.confirmed.update(confirmed)
        return {number: Score(confirmed.get(number, screened[number])) for number in designs}

    def conclude(self, number: int, candidates: Sequence[Candidate]) -> Generation:
        """Return the generation of these candidates, whose best is validated.

        Raises:
            InputError, RunStopped: see ``evaluate``.
        """
        best, space = self._find_best(candidates), self.experiment.space
        if self.experiment.plan.validation_trials and best.individual.id not in self.validated:
            designs = self._decode([best.individual])
            self.validated |= self._score(number, designs, VALIDATION)
        return Generation(
            number=number,
            candidates=candidates,
            genes=[space.to_row(candidate.individual.genome) for candidate in candidates],
            best=best,
            validated_fitness=dict(self.validated),
            screened_fitness=dict(self.screened) if self.experiment.confirmation else {},
            losses={i: self.screened[i] - fitness for i, fitness in self.confirmed.items()},
        )

    def _find_best(self, candidates: Sequence[Candidate]) -> Candidate:
        """Return the fittest candidate, one of the confirmed ones if there are any.

        A search that may lose its best so far keeps others that were never confirmed.
        """
        return max(
            candidates,
            key=lambda candidate: (candidate.individual.id in self.confirmed, candidate.fitness),
        )

    def _decode(self, individuals: Sequence[Individual]) -> dict[int, Design]:
        space = self.experiment.space
        return {individual.id: space.decode(individual.genome) for individual in individuals}

    def _score(
        self, generation: int, designs: Mapping[int, Design], purpose: str
    ) -> dict[int, float]:
        """Return the fitness of each design; run and record the missions that are missing."""
        experiment, journal = self.experiment, self.journal
        missions = {
            number: experiment.plan.missions(purpose, generation, number, design)
            for number, design in designs.items()
        }
        needed = [mission for of_design in missions.values() for mission in of_design]
        self.observer.begin(generation, len(needed), sum(map(journal.has, needed)))
        scenario = experiment.scenario_for(purpose)
        self.dispatcher.run_missing(scenario, needed, journal, self.observer.mission)
        found = ((mission.key, journal.find(mission)) for mission in needed)
        outcomes = {key: outcome for key, outcome in found if outcome is not None}
        return {
            number: compute_fitness(experiment.scoring, of_design, outcomes)
            for number, of_design in missions.items()
        }
