"""The recorded and new trials of a run."""

import math
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, field

from evoros.base.checks import SCORE, Rule, ask, is_real
from evoros.base.combining import mean
from evoros.base.errors import InputError
from evoros.design.design import Design
from evoros.dispatch.dispatcher import Dispatcher
from evoros.evolution.experiment import Experiment
from evoros.evolution.journal import Journal, Watcher
from evoros.evolution.stop_after import Spent
from evoros.fitness.scoring import list_trials
from evoros.measure.protocol import DESCRIPTORS, MINIMIZE, OBJECTIVES, Evaluated, Measure
from evoros.mission.member import Member
from evoros.mission.mission import Mission, MissionKey, Outcome, Outcomes, judge
from evoros.mission.plan import ACTIVITIES, SEARCHING, VALIDATION
from evoros.mission.scenario import Scenario
from evoros.optimizer.protocol import Individual, Score
from evoros.robot.model import Robot
from evoros.terminal.activity import announce
from evoros.terminal.log import LOGGER

A_NUMBER = Rule("a number", is_real)


@dataclass
class Measuring:
    """Computes scores, and reports faults of each measure once."""

    experiment: Experiment
    trials: dict[tuple[str, int], list[list[Outcomes]]] = field(default_factory=dict)
    """Outcomes of trials by purpose and individual, if any measure requires them."""
    reported: set[str] = field(default_factory=set)

    def note(
        self,
        purpose: str,
        missions: Mapping[int, Sequence[Mission]],
        outcomes: Mapping[MissionKey, Outcomes],
    ) -> None:
        """Store the trials that determine the fitness of individuals."""
        measures = list_measures(self.experiment).values()
        if purpose in SEARCHING and not all(part.of_design for part in measures):
            for design_id, of_design in missions.items():
                trials = list_trials(of_design, outcomes)
                self.trials.setdefault((purpose, design_id), []).extend(trials)

    def keep(self, individuals: Container[int]) -> None:
        """Discard the trials of all other individuals."""
        self.trials = {key: kept for key, kept in self.trials.items() if key[1] in individuals}

    def score(self, purpose: str, design_id: int, design: Design, fitness: float) -> Score:
        """Return an individual's score from its fitness and its trials for a purpose."""
        measures, experiment = list_measures(self.experiment), self.experiment
        if not measures:
            return Score(fitness)
        evaluated = Evaluated(
            design,
            equip_robots(experiment.scenario, design),
            self.trials.get((purpose, design_id), []),
            fitness,
            experiment.scoring.score_trial,
        )
        values = {key: self._compute(key, part, evaluated) for key, part in measures.items()}
        return read_score(experiment, {"fitness": fitness, **values})

    def _compute(self, key: str, measure: Measure, evaluated: Evaluated) -> float:
        value = float(ask(key, measure.compute, A_NUMBER, evaluated))
        if SCORE.holds(value):
            return value
        low, high = map(float, measure.bounds)
        worst = high if measure.direction == MINIMIZE else low
        self._report(
            key,
            f"must be {SCORE.text}, but is {value:g} for the design "
            f"{', '.join(str(mount) for mount in evaluated.design.mounts)[:200]}; such designs "
            f"get the value {worst:g}; correct {type(measure).__name__}",
        )
        return worst

    def check_variety(self, scores: Mapping[int, Score]) -> None:
        """Report descriptors that have the same value for all designs of a generation."""
        if len(scores) < 2:
            return
        for place, name in enumerate(self.experiment.descriptors):
            values = {score.descriptor[place] for score in scores.values()}
            if len(values) == 1:
                self._report(
                    f"{DESCRIPTORS}.{name}",
                    f"should differ between designs, but is {values.pop():g} for all "
                    f"{len(scores)} designs of a generation; choose another descriptor",
                )

    def _report(self, key: str, problem: str) -> None:
        if key not in self.reported:
            self.reported.add(key)
            LOGGER.warning("%s: %s", key, problem)


def list_measures(experiment: Experiment) -> dict[str, Measure]:
    """Return the objectives and descriptors by key, which is also the table column."""
    return {
        f"{group}.{name}": measure
        for group in (OBJECTIVES, DESCRIPTORS)
        for name, measure in getattr(experiment, group).items()
    }


def _sign(measure: Measure) -> float:
    return -1.0 if measure.direction == MINIMIZE else 1.0


def list_values(experiment: Experiment, score: Score) -> list[float]:
    """Return the objectives and descriptors of a score, with the signs of the measures."""
    signs = map(_sign, experiment.objectives.values())
    objectives = (sign * value for sign, value in zip(signs, score.objectives, strict=True))
    return [*objectives, *score.descriptor]


def read_score(experiment: Experiment, row: Mapping[str, float]) -> Score:
    """Return the score in a table row of the fitness and each measure, by key."""
    objectives = (
        _sign(measure) * row[f"{OBJECTIVES}.{name}"]
        for name, measure in experiment.objectives.items()
    )
    descriptor = (row[f"{DESCRIPTORS}.{name}"] for name in experiment.descriptors)
    return Score(row["fitness"], tuple(objectives), tuple(descriptor))


def equip_robots(scenario: Scenario, design: Design) -> dict[str, Robot]:
    """Return the robots that have separate designs, equipped with the sensors of the design."""
    owners = (member for member in scenario.members if member.has_own_design)
    return {member.name: _equip(member, member.find_design(design)) for member in owners}


def _equip(member: Member, design: Design) -> Robot:
    try:
        return member.with_design(design).robot
    except InputError:  # a part rejects the evolved values
        return member.robot.with_sensors(design.mounts, member.design.sensors)


@dataclass(frozen=True)
class Trials:
    """Runs the missions missing in a journal, and scores all missions."""

    experiment: Experiment
    journal: Journal
    watcher: Watcher
    dispatcher: Dispatcher
    measuring: Measuring
    spent: Spent = field(default_factory=Spent)

    def decode(self, individuals: Sequence[Individual]) -> dict[int, Design]:
        """Return the design of each individual, by id."""
        space = self.experiment.space
        return {individual.id: space.decode(individual.genome) for individual in individuals}

    def score(
        self, generation: int, missions: Mapping[int, Sequence[Mission]], purpose: str
    ) -> dict[int, list[float]]:
        """Return the scores of each design's trials; raise an InputError if one is not finite."""
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
        """Return the outcomes of missions in one generation."""
        journal = self.journal
        if not needed:
            return {}
        self.watcher.begin(generation, len(needed), sum(map(journal.has, needed)))
        scenario, before = self.experiment.scenario_for(purpose), self.dispatcher.meter.processor_s
        with announce(ACTIVITIES[purpose]):
            self.dispatcher.run_missing(scenario, needed, journal, self.watcher.mission)
        recorded = ((mission.key, journal.find(mission)) for mission in needed)
        known = {key: outcome for key, outcome in recorded if outcome is not None}
        if purpose in SEARCHING:
            self.spent.missions += len(known)
            self.spent.processor_s += self.dispatcher.meter.processor_s - before
            self.spent.simulated_s += sum(judge(outcomes).time_s for outcomes in known.values())
        return known


@dataclass(frozen=True)
class FreshTrials:
    """The trials of a design on fresh draws, which selection never uses."""

    trials: list[float] = field(default_factory=list)  # scores of the trials
    # Scores of missions or, unless the fitness is additive, of trials; the mean is the same.
    scores: list[float] = field(default_factory=list)
    lowest: float = math.nan  # minimum possible score of the design; NaN before the first trial
    outcomes: Mapping[str, list[Outcome]] = field(default_factory=dict)  # keyed by world


@dataclass
class Validated:
    """Validates the best of each generation, the champion and its rivals, on equal fresh draws."""

    trials: Trials
    compared: int = 0  # number of trials used to compare designs
    fresh: dict[int, FreshTrials] = field(default_factory=dict)
    _generations: dict[int, int] = field(default_factory=dict)  # generation of each individual

    def validate(self, generation: int, individual: Individual) -> None:
        """Validate an individual, unless it is validated already or the run has no validation."""
        experiment = self.trials.experiment
        count = experiment.plan.validation_trials
        # A fitness other than a mean depends on the number of trials.
        if count and experiment.scoring.combine is not mean:
            count = max(count, min(self.compared, experiment.validation.max_trials))
        known = self.fresh.get(individual.id)
        if known is None or len(known.trials) < count:
            self._generations.setdefault(individual.id, generation)
            self.extend(individual, count)

    def extend(self, individual: Individual, count: int) -> FreshTrials:
        """Run and store ``count`` trials of a validated individual."""
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
        """Return the validated fitness of all individuals with validation trials."""
        combine = self.trials.experiment.scoring.combine
        return {i: combine(fresh.trials) for i, fresh in self.fresh.items() if fresh.trials}
