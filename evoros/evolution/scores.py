"""Scores the individuals of a run, generation by generation."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from evoros.base.rng import generator
from evoros.design.design import Design
from evoros.evolution.confirmed import Confirmed
from evoros.evolution.contest import Contest
from evoros.evolution.experiment import Experiment
from evoros.evolution.journal import Generation
from evoros.evolution.ledger import Ledger
from evoros.evolution.measuring import list_measures, list_values
from evoros.evolution.trials import Trials, Validated
from evoros.failure.case import Case
from evoros.failure.protocol import AdaptiveFailure
from evoros.mission.plan import CONFIRMATION, SELECTION
from evoros.optimizer.protocol import Candidate, Individual, Score

DROPPED = "dropped"
"""The operator of a survivor that was scored again and that the search no longer has."""


class Opposition:
    """The cases of each generation; none if the failure model does not adapt.

    They follow from the seed and from the scores of recorded missions, so that a resumed run has
    the same.
    """

    def __init__(self, experiment: Experiment) -> None:
        failure = experiment.failure
        self._adversary = None
        if isinstance(failure, AdaptiveFailure):
            trials = experiment.allocation.most_trials(experiment.trials)
            space = next(item.space for item in experiment.members if item.meets_cases)
            sensors = len(space.decode(space.middle).mounts)
            rng = generator(f"{experiment.seed}", "adversary")
            self._adversary = failure.start(sensors, trials, rng)
        self._cases: dict[int, Sequence[Case]] = {}  # by the generation

    def list_cases(self, generation: int) -> Sequence[Case]:
        """Return the cases of a generation, by the number of the trial."""
        if self._adversary is None:
            return ()
        if generation not in self._cases:
            self._cases[generation] = self._adversary.list_cases()
        return self._cases[generation]

    def tell(self, scores: Mapping[int, Sequence[float]]) -> None:
        """Let the cases of the next generation follow from the scores of each design's trials."""
        if self._adversary is not None:
            self._adversary.tell(scores)


@dataclass
class Scores:
    """The scores of a run's individuals so far.

    The ledger has values of every individual; the other fields keep a few.
    """

    trials: Trials
    survivors: list[Individual] = field(default_factory=list)  # of the last generation
    ledger: Ledger = field(init=False)
    opposition: Opposition = field(init=False)
    confirmed: Confirmed = field(init=False)
    validated: Validated = field(init=False)

    def __post_init__(self) -> None:
        experiment = self.trials.experiment
        self.ledger = Ledger(len(list_measures(experiment)), experiment.final_choice)
        self.opposition = Opposition(experiment)
        self.confirmed = Confirmed(self.trials, self.ledger)
        self.validated = Validated(self.trials)

    def evaluate(self, generation: int, individuals: Sequence[Individual]) -> dict[int, Score]:
        """Return the scores of new individuals, and of survivors that got further trials.

        Their fitness is the confirmed one, if they have been confirmed.

        Raises:
            InputError: see ``Contest.next_round`` and ``Trials.score``.
            RunStopped: a mission was lost, and the experiment stops at that.
        """
        new = {individual.id for individual in individuals}
        self.survivors = [old for old in self.survivors if old.id not in new]
        everyone = [*individuals, *self.survivors]
        designs, cases = self.trials.decode(everyone), self.opposition.list_cases(generation)
        contest = self._hold_contest(generation, designs, cases)
        self.opposition.tell(contest.scores)
        self.ledger.add_screened(contest.scores)
        for design_id in new:
            self.ledger.show(design_id, generation, 0)
        fitness = self.confirmed.confirm_best(generation, designs, contest, cases)
        scores = self._measure(designs, {i: fitness[i] for i in contest.scores})
        self.ledger.keep_finalists(everyone)
        return scores

    def _measure(
        self, designs: Mapping[int, Design], fitness: Mapping[int, float]
    ) -> dict[int, Score]:
        """Return the scores of designs, with their objectives and descriptors."""
        measuring, scores = self.trials.measuring, {}
        for design_id, value in fitness.items():
            purpose = CONFIRMATION if design_id in self.confirmed.scores else SELECTION
            score = measuring.score(purpose, design_id, designs[design_id], value)
            self.ledger.add_told(design_id, value, list_values(self.trials.experiment, score))
            scores[design_id] = score
        measuring.check_variety(scores)
        return scores

    def _hold_contest(
        self, generation: int, designs: Mapping[int, Design], cases: Sequence[Case]
    ) -> Contest:
        """Run the trials of a generation, round by round."""
        experiment = self.trials.experiment
        earlier = self.ledger.find_screened(designs)
        contest = Contest(experiment.allocation, experiment.trials, earlier, experiment.combine)
        while wanted := contest.next_round():
            missions = {
                i: experiment.plan.selection(
                    generation, i, designs[i], trials, len(earlier[i]), cases
                )
                for i, trials in wanted.items()
            }
            contest.add(self.trials.score(generation, missions, SELECTION))
        return contest

    def conclude(
        self, generation: int, candidates: Sequence[Candidate], scores: Mapping[int, Score]
    ) -> Generation:
        """Return the generation of these candidates, whose best is validated.

        Survivors that were scored again and are not among them follow, so that the table has all
        ``scores`` that the search was told.
        """
        experiment = self.trials.experiment
        present = {candidate.individual.id for candidate in candidates}
        dropped = [
            Candidate(old, DROPPED, scores[old.id].fitness, 0)
            for old in self.survivors
            if old.id in scores and old.id not in present
        ]
        rows = [*candidates, *dropped]
        alive = {row.individual.id: row.individual for row in candidates if row.survived}
        self.survivors = list(alive.values())
        self.trials.measuring.keep(alive)
        best = self._find_best(candidates)
        self.validated.validate(generation, best.individual)
        confirmed, combine = self.confirmed, experiment.combine
        lives = self.ledger.find_screened(row.individual.id for row in rows)
        screened = {i: combine(confirmed.screened.get(i, life)) for i, life in lives.items()}
        return Generation(
            number=generation,
            candidates=rows,
            genes=[experiment.space.to_row(row.individual.genome) for row in rows],
            best=best,
            measures=self._list_measures(rows),
            trials={i: len(confirmed.scores.get(i, life)) for i, life in lives.items()},
            validated_fitness=self.validated.list_fitness(),
            screened_fitness=screened if experiment.confirmation else {},
            losses=confirmed.list_losses(),
        )

    def _list_measures(self, rows: Sequence[Candidate]) -> list[dict[str, float]]:
        names = list_measures(self.trials.experiment)
        told = self.ledger.find_told(row.individual.id for row in rows)
        return [dict(zip(names, told[row.individual.id][1:], strict=True)) for row in rows]

    def _find_best(self, candidates: Sequence[Candidate]) -> Candidate:
        """Return the fittest candidate, one of the confirmed ones if there are any.

        A search that may lose its best so far keeps others that were never confirmed.
        """
        confirmed = self.confirmed.scores
        return max(candidates, key=lambda row: (row.individual.id in confirmed, row.fitness))
