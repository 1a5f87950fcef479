"""Scores the individuals of a run by missions that are recorded or run now."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from evoros.base.activity import announce
from evoros.base.combining import Combine
from evoros.design.design import Design
from evoros.evolution.contest import Contest
from evoros.evolution.dispatch import Dispatcher
from evoros.evolution.experiment import Experiment
from evoros.evolution.journal import Generation, Journal, Observer
from evoros.evolution.ledger import Ledger
from evoros.evolution.measuring import Measuring, list_values, name_measures
from evoros.evolution.opposition import Opposition
from evoros.fitness.scoring import score_trials
from evoros.mission.mission import Mission, MissionKey
from evoros.mission.outcome import Outcome
from evoros.mission.plan import ACTIVITIES, CONFIRMATION, SELECTION, VALIDATION
from evoros.optimizer.protocol import Candidate, Individual, Score

DROPPED = "dropped"
"""The operator of a survivor that was scored again and that the search no longer has."""


@dataclass
class Scores:
    """The scores of the trials of a run's individuals so far, by their id.

    What there is of every individual is in the ledger, everything else is of few.
    """

    experiment: Experiment
    journal: Journal
    observer: Observer
    dispatcher: Dispatcher
    fitness: dict[int, float] = field(default_factory=dict)  # told in this generation
    confirmed: dict[int, list[float]] = field(default_factory=dict)  # in the confirming simulator
    repeated: dict[int, list[float]] = field(default_factory=dict)  # screened, of confirmed trials
    validated: dict[int, list[float]] = field(default_factory=dict)  # under draws of their own
    validated_in: dict[int, int] = field(default_factory=dict)  # the generation of these missions
    survivors: list[Individual] = field(default_factory=list)  # of the last generation
    rescored: list[Individual] = field(default_factory=list)  # of these, in this generation
    measuring: Measuring = field(init=False)
    ledger: Ledger = field(init=False)
    opposition: Opposition = field(init=False)

    def __post_init__(self) -> None:
        self.measuring = Measuring(self.experiment)
        self.opposition = Opposition(self.experiment)
        self.ledger = Ledger(len(self.measuring.measures), self.experiment.final_choice)

    @property
    def combine(self) -> Combine:
        """Makes one fitness of the scores of trials."""
        return self.experiment.combine

    def evaluate(self, generation: int, individuals: Sequence[Individual]) -> dict[int, Score]:
        """Return the scores of new individuals, and of survivors that got further trials.

        Their fitness is confirmed if it was confirmed.

        Raises:
            InputError: the journal has a mission under other draws, a score is not finite, or the
                allocation gives a design too many trials, or a new one none.
            RunStopped: a mission was lost, and the experiment stops at that.
        """
        new = {individual.id for individual in individuals}
        old = [each for each in self.survivors if each.id not in new]
        designs = self.decode([*individuals, *old])
        contest = self._hold_contest(generation, designs)
        self.fitness = contest.fitness()
        self.ledger.add_screened(contest.scores)
        for number in new:
            self.ledger.show(number, generation, 0)
        self._confirm_best(generation, designs, contest)
        self.rescored = [each for each in old if each.id in contest.scores]
        scores = self._measure(designs, contest)
        self.ledger.keep_finalists([*individuals, *old])
        return scores

    def _measure(self, designs: Mapping[int, Design], contest: Contest) -> dict[int, Score]:
        """Return the scores of the designs of a contest, with their objectives and descriptors."""
        scores = {}
        for number in contest.scores:
            purpose = CONFIRMATION if number in self.confirmed else SELECTION
            fitness = self.fitness[number]
            scores[number] = self.measuring.score(purpose, number, designs[number], fitness)
            measured = list_values(self.experiment, scores[number])
            self.ledger.add_told(number, fitness, measured)
        self.measuring.check_variety(scores)
        return scores

    def _hold_contest(self, generation: int, designs: Mapping[int, Design]) -> Contest:
        """Run the trials of a generation, round by round."""
        experiment = self.experiment
        earlier = self.ledger.find_screened(designs)
        contest = Contest(experiment.allocation, experiment.trials, earlier, self.combine)
        cases = self.opposition.list_cases(generation)
        while wanted := contest.next_round():
            missions = {
                number: experiment.plan.selection(
                    generation, number, designs[number], trials, len(earlier[number]), cases
                )
                for number, trials in wanted.items()
            }
            contest.add(self.score(generation, missions, SELECTION))
        self.opposition.tell(contest.scores)
        return contest

    def _confirm_best(
        self, generation: int, designs: Mapping[int, Design], contest: Contest
    ) -> None:
        """Repeat the trials of the best designs of a generation in the confirming simulator."""
        confirmation, plan = self.experiment.confirmation, self.experiment.plan
        if confirmation is None:
            return

        cases = self.opposition.list_cases(generation)

        def confirm(best: Iterable[int]) -> dict[int, float]:
            missions = {}
            for number in best:
                trials, earlier = range(len(contest.scores[number])), len(contest.earlier[number])
                missions[number] = plan.confirmation(
                    *(generation, number, designs[number], trials, earlier, cases)
                )
                if number not in self.confirmed:
                    self.ledger.show(number, generation, earlier)
            for number, scores in self.score(generation, missions, CONFIRMATION).items():
                self.confirmed.setdefault(number, []).extend(scores)
                self.repeated.setdefault(number, []).extend(contest.scores[number])
            return {number: self.combine(self.confirmed[number]) for number in missions}

        self.fitness |= confirmation.confirm_best(contest.fitness(), confirm)
        self.fitness |= {
            number: self.combine(self.confirmed[number])
            for number in contest.scores
            if number in self.confirmed
        }

    def conclude(self, number: int, candidates: Sequence[Candidate]) -> Generation:
        """Return the generation of these candidates, whose best is validated.

        Survivors that were scored again and are not among them follow, so that the table has
        everything that the search was told.

        Raises:
            InputError, RunStopped: see ``evaluate``.
        """
        best, space = self._find_best(candidates), self.experiment.space
        present = {candidate.individual.id for candidate in candidates}
        dropped = [
            Candidate(each, DROPPED, self.fitness[each.id], 0)
            for each in self.rescored
            if each.id not in present
        ]
        rows = [*candidates, *dropped]
        alive = {row.individual.id: row.individual for row in candidates if row.survived}
        self.survivors = list(alive.values())
        self.measuring.keep(alive)
        self.validate(number, best.individual)
        combine = self.combine
        lives = self.ledger.find_screened(row.individual.id for row in rows)
        screened = {i: combine(self.repeated.get(i, scores)) for i, scores in lives.items()}
        return Generation(
            number=number,
            candidates=rows,
            genes=[space.to_row(candidate.individual.genome) for candidate in rows],
            best=best,
            measures=self._list_measures(rows),
            trials={i: len(self.confirmed.get(i, scores)) for i, scores in lives.items()},
            validated_fitness={i: combine(met) for i, met in self.validated.items() if met},
            screened_fitness=screened if self.experiment.confirmation else {},
            losses={
                i: combine(self.repeated[i]) - combine(met) for i, met in self.confirmed.items()
            },
        )

    def validate(self, generation: int, individual: Individual) -> None:
        """Validate an individual, unless it has been validated or the run does not validate.

        Raises:
            InputError, RunStopped: see ``evaluate``.
        """
        if individual.id not in self.validated:
            self.validated_in[individual.id] = generation
            trials = self.experiment.plan.validation_trials
            self.validated[individual.id], _ = self.validate_longer(individual, trials)

    def validate_longer(
        self, individual: Individual, trials: int
    ) -> tuple[list[float], dict[str, list[Outcome]]]:
        """Return the scores of so many validation trials, and their outcomes in each world.

        Raises:
            InputError, RunStopped: see ``evaluate``.
        """
        number, generation = individual.id, self.validated_in[individual.id]
        (design,) = self.decode([individual]).values()
        missions = self.experiment.plan.validation(generation, number, design, trials)
        outcomes = self._run(generation, missions, VALIDATION)
        by_world: dict[str, list[Outcome]] = {}
        for mission in missions:
            by_world.setdefault(mission.world, []).append(outcomes[mission.key])
        return score_trials(self.experiment.scoring, missions, outcomes), by_world

    def _list_measures(self, rows: Sequence[Candidate]) -> list[dict[str, float]]:
        names = name_measures(self.experiment)
        told = self.ledger.find_told(row.individual.id for row in rows)
        return [dict(zip(names, told[row.individual.id][1:], strict=True)) for row in rows]

    def _find_best(self, candidates: Sequence[Candidate]) -> Candidate:
        """Return the fittest candidate, one of the confirmed ones if there are any.

        A search that may lose its best so far keeps others that were never confirmed.
        """
        return max(
            candidates,
            key=lambda candidate: (candidate.individual.id in self.confirmed, candidate.fitness),
        )

    def decode(self, individuals: Sequence[Individual]) -> dict[int, Design]:
        """Return the design of each individual, by its id."""
        space = self.experiment.space
        return {individual.id: space.decode(individual.genome) for individual in individuals}

    def score(
        self, generation: int, missions: Mapping[int, Sequence[Mission]], purpose: str
    ) -> dict[int, list[float]]:
        """Return the score of each trial of each design; run and record the missing missions.

        Raises:
            InputError, RunStopped: see ``evaluate``.
        """
        needed = [mission for of_design in missions.values() for mission in of_design]
        outcomes = self._run(generation, needed, purpose)
        self.measuring.note(purpose, missions, outcomes)
        return {
            number: score_trials(self.experiment.scoring, of_design, outcomes)
            for number, of_design in missions.items()
        }

    def _run(
        self, generation: int, needed: Sequence[Mission], purpose: str
    ) -> dict[MissionKey, Outcome]:
        """Return the outcomes of missions of one generation."""
        journal = self.journal
        if not needed:
            return {}
        self.observer.begin(generation, len(needed), sum(map(journal.has, needed)))
        scenario = self.experiment.scenario_for(purpose)
        with announce(ACTIVITIES[purpose]):
            self.dispatcher.run_missing(scenario, needed, journal, self.observer.mission)
        found = ((mission.key, journal.find(mission)) for mission in needed)
        return {key: outcome for key, outcome in found if outcome is not None}
