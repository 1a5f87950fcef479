"""The trials of a design in an evaluation, of which requirements may need fewer than all."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from evoros.design.design import Design
from evoros.evolution.experiment import Experiment
from evoros.evolution.measuring import equip_robots
from evoros.measure.protocol import Evaluated, Measure
from evoros.mission.mission import Mission, MissionKey
from evoros.mission.outcome import Outcomes
from evoros.requirement.claim import Claim
from evoros.requirement.verdict import UNDECIDED, Trial, Verdict

ROUND = 10
"""Trials after which requirements that are undecided are judged again."""
Judge = Callable[[Mapping[int, Trial]], Mapping[str, Verdict]]
"""Judges requirements by trials, which are given by their numbers."""


@dataclass
class DesignTrials:
    """The missions of a design and the outcomes that are known.

    Without a ``judge`` all missions are wanted. With one, they are wanted in rounds until it has
    decided everything; so what is run follows from the outcomes alone.
    """

    missions: Mapping[MissionKey, Mission]  # trial by trial, as many as it can get
    worlds: int
    judge: Judge | None
    outcomes: dict[MissionKey, Outcomes] = field(default_factory=dict)
    verdicts: Mapping[str, Verdict] = field(default_factory=dict)
    finished: bool = False
    wanted: int = 0  # of the missions so far

    def __post_init__(self) -> None:
        self._want_more()

    def _want_more(self) -> None:
        more = len(self.missions) if self.judge is None else ROUND * self.worlds
        self.wanted = min(self.wanted + more, len(self.missions))

    def list_wanted(self) -> list[Mission]:
        """Return the missions that are wanted so far."""
        return list(self.missions.values())[: self.wanted]

    def take(self, key: MissionKey, outcomes: Outcomes) -> None:
        """Take the outcomes of a mission, and judge once all that are wanted are known."""
        self.outcomes[key] = outcomes
        while not self.finished and len(self.outcomes) >= self.wanted:
            if not all(mission.key in self.outcomes for mission in self.list_wanted()):
                return
            if self.judge is not None:
                self.verdicts = self.judge(self._list_trials())
            decided = all(verdict.result != UNDECIDED for verdict in self.verdicts.values())
            self.finished = self.wanted == len(self.missions) or (decided and bool(self.verdicts))
            if not self.finished:
                self._want_more()

    def _list_trials(self) -> Mapping[int, Trial]:
        trials: dict[int, dict[str, Outcomes]] = {}
        for mission in self.list_wanted():
            trials.setdefault(mission.trial, {})[mission.world] = self.outcomes[mission.key]
        return trials


def make_judge(experiment: Experiment, design: Design) -> Judge | None:
    """Return what judges the claims about the trials of a design; None if there are none."""
    requirements = experiment.requirements.items()
    claims = {name: claim for name, claim in requirements if isinstance(claim, Claim)}
    if not claims:
        return None

    def measure(part: Measure, trial: Trial) -> float:
        outcomes = [list(trial.values())]
        score = experiment.scoring.score_trial(outcomes[0])
        robots = equip_robots(experiment.scenario, design)
        evaluated = Evaluated(design, robots, outcomes, score, experiment.scoring.score_trial)
        return float(part.compute(evaluated))

    def judge(trials: Mapping[int, Trial]) -> dict[str, Verdict]:
        agents = list(experiment.agents)
        return {name: claim.judge(trials, agents, measure) for name, claim in claims.items()}

    return judge
