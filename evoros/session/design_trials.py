"""The trials of a design in an evaluation, which continue until all requirements are decided."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

from evoros.base.checks import ask
from evoros.design.design import Design
from evoros.evolution.experiment import Experiment
from evoros.evolution.trials import A_NUMBER, equip_robots
from evoros.measure.protocol import Evaluated, Measure
from evoros.mission.mission import Mission, MissionKey, Outcomes
from evoros.requirement.claim import OWN, Condition
from evoros.requirement.requirements import ROUND, Assessment, Judged
from evoros.requirement.verdict import Trial

GENERATION = 0  # generation number for the random draws of all evaluated designs


@dataclass
class DesignTrials:
    """The missions and outcomes of a design, in rounds until all requirements are decided."""

    experiment: Experiment
    index: int
    design: Design
    outcomes: dict[MissionKey, Outcomes] = field(default_factory=dict)
    wanted: int = 0  # number of missions planned so far
    finished: bool = False

    def __post_init__(self) -> None:
        experiment, trials = self.experiment, self.experiment.plan.evaluation_trials
        ends_early = experiment.requirements and experiment.worst_cases is None
        self.assessment = Assessment(
            experiment.requirements,
            list(experiment.world),
            len(self.design.mounts),
            trials,
            ROUND if ends_early else trials,
        )
        self._listed: dict[Condition, list[Mission]] = {}
        self.wanted = self._count_wanted()

    @property
    def conditions(self) -> Sequence[Condition]:
        """The conditions of the design's missions; the first is the evaluation's."""
        return self.assessment.conditions

    @property
    def known(self) -> int:
        """The number of missions with known outcomes."""
        return self.wanted if self.finished else len(self.outcomes)

    @property
    def most(self) -> int:
        """The maximum number of missions that the design can need, including those already run."""
        counts = [len(self.assessment.list_worlds(one)) for one in self.conditions]
        trials = self.experiment.plan.evaluation_trials
        return self.wanted if self.finished else trials * sum(counts)

    @cached_property
    def _own(self) -> Sequence[Mission]:
        return self.experiment.plan.evaluation(GENERATION, self.index, self.design)

    def list_wanted(self, condition: Condition) -> list[Mission]:
        """Return the missions planned so far under one condition."""
        listed = self._listed.setdefault(condition, [])
        worlds = self.assessment.list_worlds(condition)
        known, wanted = len(listed) // len(worlds), self.assessment.wanted.get(condition, 0)
        if known < wanted:
            listed += self._list(condition, range(known, wanted))
        return list(listed)

    def list_all(self) -> list[Mission]:
        """Return the missions planned so far under all conditions."""
        return [mission for one in self.conditions for mission in self.list_wanted(one)]

    def _list(self, condition: Condition, repeats: range) -> list[Mission]:
        worlds = self.assessment.list_worlds(condition)
        if condition == OWN:
            return list(self._own[repeats.start * len(worlds) : repeats.stop * len(worlds)])
        number = self.conditions.index(condition)
        setting = "" if condition.case else condition.text
        place = (self.index, self.design, number, repeats)
        missions = self.experiment.plan.stated(*place, condition.case, setting)
        return [mission for mission in missions if mission.world in worlds]

    def take(self, key: MissionKey, outcomes: Outcomes) -> None:
        """Store a mission's outcomes; judge the design once all planned missions have outcomes."""
        self.outcomes[key] = outcomes
        while not self.finished and len(self.outcomes) >= self.wanted:
            if not all(mission.key in self.outcomes for mission in self.list_all()):
                return
            agents = list(self.experiment.agents)
            self.assessment.advance(self._list_trials(), agents, self._measure)
            self.finished, self.wanted = self.assessment.finished, self._count_wanted()

    def _count_wanted(self) -> int:
        wanted = self.assessment.wanted.items()
        return sum(count * len(self.assessment.list_worlds(one)) for one, count in wanted)

    def judge(self) -> Mapping[str, Judged]:
        """Return the verdicts on all trials, by requirement."""
        agents = list(self.experiment.agents)
        return self.assessment.judge(self._list_trials(), agents, self._measure)

    def _list_trials(self) -> Mapping[Condition, Mapping[int, Trial]]:
        trials: dict[Condition, dict[int, dict[str, Outcomes]]] = {}
        for condition in self.conditions:
            of_condition = trials.setdefault(condition, {})
            for mission in self.list_wanted(condition):
                outcomes = self.outcomes[mission.key]
                of_condition.setdefault(mission.trial, {})[mission.world] = outcomes
        return trials

    def _measure(self, part: Measure, trial: Trial) -> float:
        outcomes, scoring = [list(trial.values())], self.experiment.scoring
        score = scoring.score_trial(outcomes[0])
        robots = equip_robots(self.experiment.scenario, self.design)
        evaluated = Evaluated(self.design, robots, outcomes, score, scoring.score_trial)
        return float(ask("requirements", part.compute, A_NUMBER, evaluated))

    def forget(self) -> None:
        """Free the memory used by a finished design's outcomes and missions."""
        self.outcomes.clear()
        self._listed.clear()
        self.__dict__.pop("_own", None)
