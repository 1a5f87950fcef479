"""The trials of the designs in one generation, in rounds chosen by the allocation."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from evoros.allocation.protocol import Allocation, Standing, cap_fitness
from evoros.base.checks import Rule, ask, is_whole
from evoros.base.combining import Combine, mean
from evoros.base.errors import InputError

ROUND = Rule(
    "a mapping from design ids to numbers of trials",
    lambda v: isinstance(v, Mapping) and all(map(is_whole, v.values())),
)


@dataclass
class Contest:
    """The designs that compete for trials, and their scores so far."""

    allocation: Allocation
    trials: int  # value of the experiment's key ``trials``
    earlier: Mapping[int, list[float]]
    combine: Combine = mean  # rule by which the experiment combines scores
    scores: dict[int, list[float]] = field(default_factory=dict)  # only for designs with trials
    rounds: list[Mapping[int, int]] = field(default_factory=list)

    def next_round(self) -> dict[int, range]:
        """Return each design's next trials, by number; {} at the end of the contest."""
        standings = [
            Standing(i, tuple(self.scores.get(i, ())), tuple(earlier), self.combine)
            for i, earlier in self.earlier.items()
        ]
        further = dict(ask("allocation", self.allocation.next_round, ROUND, standings, self.trials))
        if not further:
            self._check_new()
            return {}
        most = self.allocation.most_trials(self.trials)
        wanted = {}
        for design_id, trials in further.items():
            done = len(self.scores.get(design_id, ()))
            if design_id not in self.earlier or trials < 1 or done + trials > most:
                raise self._refuse(
                    "must give only designs of this generation further trials, at least 1 and at "
                    f"most {most} in total, but gave {trials} to design {design_id}, which has "
                    f"{done}"
                )
            wanted[design_id] = range(done, done + trials)
        self.rounds.append(further)
        return wanted

    def add(self, scores: Mapping[int, list[float]]) -> None:
        """Add the scores of the trials in a round."""
        for design_id, new in scores.items():
            self.scores.setdefault(design_id, []).extend(new)

    def fitness(self) -> dict[int, float]:
        """Return the fitness of each design with trials, over all of its generations."""
        lives = {i: [*self.earlier[i], *new] for i, new in self.scores.items()}
        fitness = {i: self.combine(life, self.compared) for i, life in lives.items()}
        return cap_fitness(fitness, self.rounds)

    @property
    def compared(self) -> int:
        """The number of trials for comparisons, which all designs of the last round have."""
        last = self.rounds[-1] if self.rounds else ()
        return min((len(self.earlier[i]) + len(self.scores[i]) for i in last), default=0)

    def stays(self) -> dict[int, int]:
        """Return the index of each design's last round; -1 if it had none."""
        last = {i: place for place, ids in enumerate(self.rounds) for i in ids}
        return {i: last.get(i, -1) for i in self.scores}

    def _check_new(self) -> None:
        for i, earlier in self.earlier.items():
            if not earlier and i not in self.scores:
                raise self._refuse(
                    f"must give trials to each new design, but gave none to design {i}"
                )

    def _refuse(self, rule: str) -> InputError:
        return InputError(f"allocation: {rule}; correct {type(self.allocation).__name__}")
