"""The trials that the designs of one generation get, in the rounds of the allocation."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from evoros.allocation.protocol import Allocation, Standing, cap_fitness
from evoros.base.combining import Combine, mean
from evoros.base.errors import InputError


@dataclass
class Contest:
    """Designs that may get trials, and the scores of the trials that they got.

    ``earlier`` has the scores of each design in earlier generations, none of a new one.
    """

    allocation: Allocation
    trials: int  # of the experiment
    earlier: Mapping[int, list[float]]
    combine: Combine = mean  # of the experiment's fitness
    scores: dict[int, list[float]] = field(default_factory=dict)  # of those that got trials
    rounds: list[Mapping[int, int]] = field(default_factory=list)

    def next_round(self) -> dict[int, range]:
        """Return the numbers of the trials that designs get now; empty: the contest is over.

        Raises:
            InputError: the allocation gives a design too many trials, or a new one none.
        """
        standings = [
            Standing(i, tuple(self.scores.get(i, ())), tuple(earlier), self.combine)
            for i, earlier in self.earlier.items()
        ]
        further = dict(self.allocation.next_round(standings, self.trials))
        if not further:
            self._check_new()
            return {}
        most = self.allocation.most_trials(self.trials)
        wanted = {}
        for design_id, trials in further.items():
            done = len(self.scores.get(design_id, ()))
            if design_id not in self.earlier or trials < 1 or done + trials > most:
                raise self._refuse(
                    f"must give at least 1 further trial, and at most {most} in a generation, to "
                    f"designs of this generation, not {trials} to design {design_id}, which has "
                    f"{done}"
                )
            wanted[design_id] = range(done, done + trials)
        self.rounds.append(further)
        return wanted

    def add(self, scores: Mapping[int, list[float]]) -> None:
        """Add the scores of the trials of a round."""
        for design_id, new in scores.items():
            self.scores.setdefault(design_id, []).extend(new)

    def fitness(self) -> dict[int, float]:
        """Return the fitness over the life of each design that got trials.

        None ranks above designs that stayed in the contest longer.
        """
        lives = {i: [*self.earlier[i], *new] for i, new in self.scores.items()}
        return cap_fitness({i: self.combine(life) for i, life in lives.items()}, self.rounds)

    def stays(self) -> dict[int, int]:
        """Return how many rounds each design stayed in; the last round counts, not its trials."""
        last = {i: place for place, ids in enumerate(self.rounds) for i in ids}
        return {i: last.get(i, -1) for i in self.scores}

    def _check_new(self) -> None:
        for i, earlier in self.earlier.items():
            if not earlier and i not in self.scores:
                raise self._refuse(f"must give trials to each new design, not none to {i}")

    def _refuse(self, rule: str) -> InputError:
        return InputError(f"allocation: {rule}; correct {type(self.allocation).__name__}")
