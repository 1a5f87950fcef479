"""The cases of failures that evolve against the designs of a run."""

from collections.abc import Mapping, Sequence

import numpy as np

from evoros.base.rng import generator
from evoros.evolution.experiment import Experiment
from evoros.failure.case import Case
from evoros.failure.protocol import AdaptiveFailure


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
            sensors = len(space.decode(np.full(space.size, 0.5)).mounts)
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
