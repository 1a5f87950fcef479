"""Computation of designs' objectives and descriptors."""

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, field
from numbers import Real

from evoros.base.checks import SCORE, Rule, ask
from evoros.base.errors import InputError
from evoros.design.design import Design
from evoros.evolution.experiment import Experiment
from evoros.fitness.scoring import list_trials
from evoros.measure.protocol import DESCRIPTORS, MINIMIZE, OBJECTIVES, Evaluated, Measure
from evoros.mission.member import Member
from evoros.mission.mission import Mission, MissionKey
from evoros.mission.outcome import Outcomes
from evoros.mission.plan import CONFIRMATION, SELECTION
from evoros.mission.scenario import Scenario
from evoros.optimizer.protocol import Score
from evoros.robot.model import Robot
from evoros.terminal.log import LOGGER

A_NUMBER = Rule("a number", lambda v: isinstance(v, Real))


@dataclass
class Measuring:
    """Computes scores, and reports faults once per measure."""

    experiment: Experiment
    trials: dict[tuple[str, int], list[list[Outcomes]]] = field(default_factory=dict)
    """The outcomes of trials by purpose and individual, if a measure needs them."""
    reported: set[str] = field(default_factory=set)

    def note(
        self,
        purpose: str,
        missions: Mapping[int, Sequence[Mission]],
        outcomes: Mapping[MissionKey, Outcomes],
    ) -> None:
        """Store the trials that determine the fitness of individuals."""
        measures = list_measures(self.experiment).values()
        if purpose in (SELECTION, CONFIRMATION) and not all(part.of_design for part in measures):
            for design_id, of_design in missions.items():
                trials = list_trials(of_design, outcomes)
                self.trials.setdefault((purpose, design_id), []).extend(trials)

    def keep(self, individuals: Container[int]) -> None:
        """Forget the trials of all other individuals."""
        self.trials = {key: kept for key, kept in self.trials.items() if key[1] in individuals}

    def score(self, purpose: str, design_id: int, design: Design, fitness: float) -> Score:
        """Return the score of an individual from its fitness and its trials of a purpose."""
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
        """Return the value of a measure; the worst of its bounds if it is not finite."""
        value = float(ask(key, measure.compute, A_NUMBER, evaluated))
        if SCORE.holds(value):
            return value
        low, high = map(float, measure.bounds)
        worst = high if measure.direction == MINIMIZE else low
        self._report(
            key,
            f"must be {SCORE.text}, not {value:g} as for the design "
            f"{', '.join(str(mount) for mount in evaluated.design.mounts)[:200]}; such designs "
            f"count as {worst:g}; correct {type(measure).__name__}",
        )
        return worst

    def check_variety(self, scores: Mapping[int, Score]) -> None:
        """Report descriptors that are equal for all designs of a generation."""
        if len(scores) < 2:
            return
        for place, name in enumerate(self.experiment.descriptors):
            values = {score.descriptor[place] for score in scores.values()}
            if len(values) == 1:
                self._report(
                    f"{DESCRIPTORS}.{name}",
                    f"should differ between designs, not be {values.pop():g} for all "
                    f"{len(scores)} of a generation; choose another one",
                )

    def _report(self, key: str, problem: str) -> None:
        if key not in self.reported:
            self.reported.add(key)
            LOGGER.warning("%s: %s", key, problem)


def list_measures(experiment: Experiment) -> dict[str, Measure]:
    """Return the objectives and descriptors by key, which is also their table column."""
    return {
        f"{group}.{name}": measure
        for group in (OBJECTIVES, DESCRIPTORS)
        for name, measure in getattr(experiment, group).items()
    }


def _sign(measure: Measure) -> float:
    """Return the factor that makes an objective one to maximize."""
    return -1.0 if measure.direction == MINIMIZE else 1.0


def list_values(experiment: Experiment, score: Score) -> list[float]:
    """Return the objectives and descriptors of a score with the signs of their measures."""
    signs = map(_sign, experiment.objectives.values())
    objectives = (sign * value for sign, value in zip(signs, score.objectives, strict=True))
    return [*objectives, *score.descriptor]


def read_score(experiment: Experiment, row: Mapping[str, float]) -> Score:
    """Return the score in a table row with the fitness and each measure by key."""
    objectives = (
        _sign(measure) * row[f"{OBJECTIVES}.{name}"]
        for name, measure in experiment.objectives.items()
    )
    descriptor = (row[f"{DESCRIPTORS}.{name}"] for name in experiment.descriptors)
    return Score(row["fitness"], tuple(objectives), tuple(descriptor))


def equip_robots(scenario: Scenario, design: Design) -> dict[str, Robot]:
    """Return the robots with their own design, equipped with its sensors.

    If a part refuses the evolved values, the sensors are as configured.
    """
    owners = (member for member in scenario.members if member.has_own_design)
    return {member.name: _equip(member, member.find_design(design)) for member in owners}


def _equip(member: Member, design: Design) -> Robot:
    try:
        return member.with_design(design).robot
    except InputError:
        return member.robot.with_sensors(design.mounts, member.design.sensors)
