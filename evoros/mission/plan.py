"""Plans the missions that score a design, and the keys of their random draws."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product

from evoros.design.design import Design
from evoros.failure.case import Case
from evoros.mission.mission import Mission

SELECTION, CONFIRMATION = "selection", "confirmation"
VALIDATION, EVALUATION = "validation", "evaluation"
FINAL = "final"
ACTIVITIES = {
    **dict.fromkeys((SELECTION, EVALUATION), ""),
    CONFIRMATION: "confirming",
    VALIDATION: "validating",
    FINAL: "choosing the champion",
}
"""Words for the activity while missions of a purpose run; empty: the usual."""
POLICIES = ("generation", "individual", "run")
STOP, WORST = "stop", "worst"
MOST_REPEATS = 1000
"""The number of trials that a stated case can have; even."""


@dataclass(frozen=True)
class Plan:
    """Plans the missions of designs.

    The missions of one trial differ in their world only. Missions with equal keys of draws meet
    the same failures, noise and generated worlds.
    """

    seed: int
    worlds: tuple[str, ...]
    trials: int
    validation_trials: int
    policy: str  # one of POLICIES: selection repeats its draws within it
    most_trials: int = 0  # of a design in one generation, in selection, if more than ``trials``
    most_validation_trials: int = 0  # of a champion, if more than ``validation_trials``
    evaluation_draws: str = EVALUATION  # or VALIDATION: the draws of a run's validation
    revalidation_trials: int = 0  # of an evaluation under the draws of a validation

    def missions(
        self, purpose: str, generation: int, design_id: int, design: Design
    ) -> list[Mission]:
        """Return the missions of a design for a purpose, for example ``SELECTION``."""
        plans: dict[str, Callable[[int, int, Design], list[Mission]]] = {
            SELECTION: self.selection,
            VALIDATION: self.validation,
            CONFIRMATION: self.confirmation,
            EVALUATION: self.evaluation,
        }
        return plans[purpose](generation, design_id, design)

    def selection(
        self,
        generation: int,
        design_id: int,
        design: Design,
        trials: range | None = None,
        earlier: int = 0,
        cases: Sequence[Case] = (),
    ) -> list[Mission]:
        """Return the missions that give a design its fitness.

        ``trials`` numbers the trials of this generation, by default a new design's trials.
        ``earlier`` counts the design's trials in earlier generations; no draw is met again. With
        ``cases``, the trial 0 of a generation meets the first, and so on.
        """
        groups = {
            "generation": f"{generation}",
            "individual": f"{generation}:{design_id}",
            "run": "all",
        }
        trials = range(self.trials) if trials is None else trials
        skipped = earlier if self.policy == "run" else 0
        group = groups[self.policy]
        missions = self._missions(generation, design_id, design, SELECTION, group, trials, skipped)
        if not cases:
            return missions
        return [replace(item, case=cases[item.trial % len(cases)]) for item in missions]

    def validation(
        self, generation: int, design_id: int, design: Design, count: int | None = None
    ) -> list[Mission]:
        """Return missions under draws that no selection uses, the same for every design.

        Their trials are numbered after the selection's. A champion may get a ``count`` of more
        trials than ``validation_trials``; these are numbered after the confirmation's.
        """
        count = self.validation_trials if count is None else count
        trials = range(self._selected, self._selected + min(count, self.validation_trials))
        further = range(self._confirmed, self._confirmed + count - len(trials))
        numbers = [*trials, *further]
        return self._missions(generation, design_id, design, VALIDATION, "all", numbers)

    def final(
        self, generation: int, design_id: int, design: Design, trials: range
    ) -> list[Mission]:
        """Return missions of the final choice, under fresh draws, the same for all designs.

        Their trials are numbered after all others.
        """
        after = self._confirmed + max(0, self.most_validation_trials - self.validation_trials)
        numbers = range(after + trials.start, after + trials.stop)
        return self._missions(generation, design_id, design, FINAL, "all", numbers)

    def confirmation(
        self,
        generation: int,
        design_id: int,
        design: Design,
        trials: range | None = None,
        earlier: int = 0,
        cases: Sequence[Case] = (),
    ) -> list[Mission]:
        """Return the missions of ``selection``, with the same draws, for another simulator.

        Their trials are numbered after the validation's.
        """
        after = self._selected + self.validation_trials
        return [
            replace(mission, trial=after + mission.trial, purpose=CONFIRMATION)
            for mission in self.selection(generation, design_id, design, trials, earlier, cases)
        ]

    def evaluation(self, generation: int, design_id: int, design: Design) -> list[Mission]:
        """Return the missions of a design in an evaluation.

        No run uses their draws for selection or validation, unless ``evaluation_draws`` asks for
        the draws of its validation.
        """
        if self.evaluation_draws == VALIDATION:
            return self.validation(generation, design_id, design, self.revalidation_trials)
        return self._missions(
            generation, design_id, design, EVALUATION, f"{generation}", range(self.trials)
        )

    @property
    def evaluation_trials(self) -> int:
        """The number of missions of a design in each world, in an evaluation."""
        return self.revalidation_trials if self.evaluation_draws == VALIDATION else self.trials

    def stated(
        self, design_id: int, design: Design, case: Case, index: int, repeats: range
    ) -> list[Mission]:
        """Return missions of an evaluation that meet a case, under the draws of its first trials.

        ``index`` numbers the case; ``repeats`` counts its missions in each world, from 0 to
        below ``MOST_REPEATS``. Trials are numbered after the evaluation's, so that each has
        the parity of the trial whose draws it has.
        """
        first = self.trials + self.trials % 2 + index * MOST_REPEATS
        missions = self._missions(0, design_id, design, EVALUATION, "0", repeats)
        return [replace(item, trial=first + item.trial, case=case) for item in missions]

    @property
    def _selected(self) -> int:
        """The first number that no trial of the selection has."""
        return max(self.trials, self.most_trials)

    @property
    def _confirmed(self) -> int:
        """The first number that no trial of selection, validation and confirmation has."""
        return 2 * self._selected + self.validation_trials

    def _missions(
        self,
        generation: int,
        design_id: int,
        design: Design,
        purpose: str,
        group: str,
        trials: Sequence[int],
        skipped: int = 0,
    ) -> list[Mission]:
        """Return missions in all worlds; a ``group`` shares its draws.

        The draws are numbered as the trials are, after so many that are skipped.
        """
        missions = []
        for trial, world in product(trials, self.worlds):
            draws = f"{self.seed}/{purpose}/{group}/{world}/{skipped + trial}"
            missions.append(Mission(generation, design_id, design, world, trial, purpose, draws))
        return missions


def count_round(purpose: str, generation: int, trial: int) -> int:
    """Number the round of a mission, whose parity is the direction of some courses.

    A selection counts generations, as the original runs did. A validation or an evaluation
    compares designs of all generations, so it counts its trials: each design meets both directions.
    """
    if purpose in (SELECTION, CONFIRMATION):
        return generation
    return trial if purpose in (VALIDATION, FINAL) else generation + trial


def describe(mission: Mission) -> str:
    """Name a mission in a message."""
    return (
        f"the mission of design {mission.design_id} in {mission.world}, "
        f"generation {mission.generation}, trial {mission.trial}"
    )
