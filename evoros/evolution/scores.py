"""Scores the individuals of a run, generation by generation."""

from array import array
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from evoros.allocation.once import Once
from evoros.base.rng import deal, generator
from evoros.certificate.confirmation import confirm_best
from evoros.certificate.final_choice import FinalChoice, find_finalists
from evoros.design.design import Design
from evoros.evolution.contest import Contest
from evoros.evolution.experiment import Experiment
from evoros.evolution.journal import Generation
from evoros.evolution.trials import Trials, Validated, list_measures, list_values
from evoros.failure.protocol import AdaptiveFailure, Case
from evoros.mission.plan import CONFIRMATION, SELECTION
from evoros.optimizer.protocol import Candidate, Individual, Score


class NumberLog:
    """A log of rows of ``width`` numbers; each row belongs to an individual."""

    def __init__(self, width: int) -> None:
        self._width = width
        self._individuals, self._numbers = array("q"), array("d")

    def add(self, individual: int, row: Sequence[float]) -> None:
        """Add a row of ``width`` numbers."""
        if len(row) != self._width:
            raise ValueError(f"a row must have {self._width} numbers, not {len(row)}")
        self._individuals.append(individual)
        self._numbers.extend(row)

    def find(self, individuals: Iterable[int]) -> dict[int, list[list[float]]]:
        """Return the rows of each individual; the list is empty for an individual without rows."""
        rows: dict[int, list[list[float]]] = {i: [] for i in individuals}
        known = np.asarray(self._individuals)
        numbers = np.asarray(self._numbers).reshape(-1, self._width)
        for place in np.flatnonzero(np.isin(known, list(rows))).tolist():
            rows[int(known[place])].append(numbers[place].tolist())
        return rows

    def find_last(self, individuals: Iterable[int]) -> dict[int, list[float]]:
        """Return the last row of each individual, all of which must have rows."""
        return {i: rows[-1] for i, rows in self.find(individuals).items()}


class Ledger:
    """The scores of all individuals in a run so far, keyed by id."""

    def __init__(self, measures: int, final_choice: FinalChoice | None) -> None:
        self._final_choice = final_choice
        self.screened = NumberLog(1)  # score of one trial in the run's own simulator
        self.told = NumberLog(1 + measures)  # fitness and measures reported to the search
        self._shown = NumberLog(2)  # arguments ``generation`` and ``earlier`` of ``show``
        self.finalists: dict[int, Individual] = {}
        """The best finished individuals, and any whose fitness may change; empty if not needed."""

    def find_screened(self, individuals: Iterable[int]) -> dict[int, list[float]]:
        """Return the scores of all trials of each individual."""
        by_id = self.screened.find(individuals)
        return {i: [score for (score,) in rows] for i, rows in by_id.items()}

    def find_told(self, individuals: Iterable[int]) -> dict[int, list[float]]:
        """Return the fitness and measures last reported to the search for each individual."""
        return self.told.find_last(individuals)

    def find_fitness(self, individuals: Iterable[int]) -> dict[int, float]:
        """Return the fitness last reported to the search for each individual."""
        return {i: row[0] for i, row in self.find_told(individuals).items()}

    def show(self, individual: int, generation: int, earlier: int) -> None:
        """Record the generation whose trials are shown if the individual becomes the champion."""
        self._shown.add(individual, (generation, earlier))

    def find_shown(self, individual: int) -> tuple[int, int]:
        """Return the generation and number of earlier trials that ``show`` recorded last."""
        generation, earlier = self._shown.find_last([individual])[individual]
        return int(generation), int(earlier)

    def keep_finalists(self, alive: Iterable[Individual]) -> None:
        """Keep the individuals that a final choice may consider."""
        if self._final_choice is None:
            return
        # only living individuals can still become one of the best
        living = {individual.id: individual for individual in alive}
        known = self.finalists | living
        ended = self.find_fitness(known.keys() - living.keys())
        kept = living.keys() | set(find_finalists(self._final_choice, ended))
        self.finalists = {i: individual for i, individual in known.items() if i in kept}


@dataclass
class Confirmed:
    """The scores of confirmed trials, and of the same trials in the run's simulator."""

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
        """Confirm the best designs; return the fitness of all designs, confirmed where possible."""
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
            return {i: experiment.scoring.combine(self.scores[i]) for i in missions}

        fitness |= confirm_best(experiment.confirmation, contest.fitness(), confirm)
        known = self.scores.keys() & contest.scores.keys()
        return fitness | {i: experiment.scoring.combine(self.scores[i]) for i in known}

    def list_losses(self) -> dict[int, float]:
        """Return the screened minus confirmed fitness of each confirmed design, by id."""
        combine = self.trials.experiment.scoring.combine
        return {i: combine(self.screened[i]) - combine(scores) for i, scores in self.scores.items()}


DROPPED = "dropped"  # operator of a survivor that was scored again and then dropped by the search


class Opposition:
    """The failure cases of each generation; none unless the failure model adapts.

    The seed and recorded scores determine them. Their order is random, so that designs with few
    trials do not meet only the first cases.
    """

    def __init__(self, experiment: Experiment) -> None:
        failure = experiment.failure
        self._key = f"{experiment.seed}/adversary"
        self._meets_all = isinstance(experiment.allocation, Once)  # then their order is irrelevant
        self._order: Sequence[int] = ()  # index of each trial's case
        self._adversary = None
        if isinstance(failure, AdaptiveFailure):
            trials = experiment.allocation.most_trials(experiment.trials)
            space = next(item.space for item in experiment.members if item.meets_cases)
            sensors = len(space.decode(space.middle).mounts)
            rng = generator(f"{experiment.seed}", "adversary")
            self._adversary = failure.start(sensors, trials, rng)
        self._cases: dict[int, Sequence[Case]] = {}  # keyed by generation

    def list_cases(self, generation: int) -> Sequence[Case]:
        """Return the cases of a generation, in the order of trials."""
        if self._adversary is None:
            return ()
        if generation not in self._cases:
            cases = self._adversary.list_cases()
            dealt = deal(f"{self._key}/{generation}", len(cases))
            places = range(len(cases))
            self._order = places if self._meets_all else [next(dealt) for _ in places]
            self._cases[generation] = [cases[place] for place in self._order]
        return self._cases[generation]

    def tell(self, scores: Mapping[int, Sequence[float]]) -> None:
        """Adapt the cases of the next generation to the scores of each design's trials."""
        if self._adversary is not None:
            self._adversary.tell(
                {i: dict(zip(self._order, met, strict=False)) for i, met in scores.items()}
            )


@dataclass
class Scores:
    """Scores the individuals of a run by generation; the ledger holds all scores."""

    trials: Trials
    survivors: list[Individual] = field(default_factory=list)  # survivors of the last generation
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
        """Return the scores of new individuals, and of survivors with more trials."""
        new = {individual.id for individual in individuals}
        self.survivors = [old for old in self.survivors if old.id not in new]
        everyone = [*individuals, *self.survivors]
        designs, cases = self.trials.decode(everyone), self.opposition.list_cases(generation)
        contest = self._hold_contest(generation, designs, cases)
        self.opposition.tell(contest.scores)
        for design_id, of_trials in contest.scores.items():
            for score in of_trials:
                self.ledger.screened.add(design_id, [score])
        for design_id in new:
            self.ledger.show(design_id, generation, 0)
        fitness = self.confirmed.confirm_best(generation, designs, contest, cases)
        scores = self._measure(designs, {i: fitness[i] for i in contest.scores})
        self.ledger.keep_finalists(everyone)
        return scores

    def _measure(
        self, designs: Mapping[int, Design], fitness: Mapping[int, float]
    ) -> dict[int, Score]:
        measuring, scores = self.trials.measuring, {}
        for design_id, value in fitness.items():
            purpose = CONFIRMATION if design_id in self.confirmed.scores else SELECTION
            score = measuring.score(purpose, design_id, designs[design_id], value)
            measures = list_values(self.trials.experiment, score)
            self.ledger.told.add(design_id, [value, *measures])
            scores[design_id] = score
        measuring.check_variety(scores)
        return scores

    def _hold_contest(
        self, generation: int, designs: Mapping[int, Design], cases: Sequence[Case]
    ) -> Contest:
        experiment = self.trials.experiment
        earlier = self.ledger.find_screened(designs)
        contest = Contest(
            experiment.allocation, experiment.trials, earlier, experiment.scoring.combine
        )
        while wanted := contest.next_round():
            missions = {
                i: experiment.plan.selection(
                    generation, i, designs[i], trials, len(earlier[i]), cases
                )
                for i, trials in wanted.items()
            }
            contest.add(self.trials.score(generation, missions, SELECTION))
        self.validated.compared = contest.compared
        return contest

    def conclude(
        self, generation: int, candidates: Sequence[Candidate], scores: Mapping[int, Score]
    ) -> Generation:
        """Validate the best of the candidates, and return the finished generation."""
        experiment = self.trials.experiment
        present = {candidate.individual.id for candidate in candidates}
        # The table contains all scores reported to the search.
        dropped = [
            Candidate(old, DROPPED, scores[old.id].fitness, 0)
            for old in self.survivors
            if old.id in scores and old.id not in present
        ]
        rows = [*candidates, *dropped]
        alive = {row.individual.id: row.individual for row in candidates if row.survived}
        self.survivors = list(alive.values())
        self.trials.measuring.keep(alive)
        best = find_best(candidates, self.confirmed.scores)
        self.validated.validate(generation, best.individual)
        confirmed, combine = self.confirmed, experiment.scoring.combine
        ids = [row.individual.id for row in rows]
        lives, told = self.ledger.find_screened(ids), self.ledger.find_told(ids)
        names = list_measures(experiment)
        screened = {i: combine(confirmed.screened.get(i, life)) for i, life in lives.items()}
        return Generation(
            number=generation,
            candidates=rows,
            genes=[experiment.space.to_row(row.individual.genome) for row in rows],
            best=best,
            measures=[dict(zip(names, told[one.individual.id][1:], strict=True)) for one in rows],
            trials={i: len(confirmed.scores.get(i, life)) for i, life in lives.items()},
            validated_fitness=self.validated.list_fitness(),
            screened_fitness=screened if experiment.confirmation else {},
            losses=confirmed.list_losses(),
        )


def find_best(candidates: Sequence[Candidate], confirmed: Container[int]) -> Candidate:
    """Return the fittest confirmed candidate, or the fittest if none is confirmed."""
    return max(candidates, key=lambda row: (row.individual.id in confirmed, row.fitness))
