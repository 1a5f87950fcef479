"""Plans the missions that score a design, with the keys of their random draws."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice, repeat
from typing import Any

from evoros.base.rng import deal
from evoros.design.design import Design
from evoros.failure.protocol import Case, SystematicFailure
from evoros.mission.mission import Mission

SELECTION, CONFIRMATION = "selection", "confirmation"
VALIDATION, EVALUATION = "validation", "evaluation"
FINAL = "final"
SEARCHING = (SELECTION, CONFIRMATION)  # purposes of missions that affect the course of a search
ACTIVITIES = {
    **dict.fromkeys((SELECTION, EVALUATION), ""),
    CONFIRMATION: "confirming",
    VALIDATION: "validating",
    FINAL: "choosing the champion",
}
"""The activity shown in the progress line for each purpose; empty: the default."""
POLICIES = ("generation", "individual", "run")
STOP, WORST = "stop", "worst"
MOST_REPEATS = 1_000_000  # larger than any number of trials, even to keep the parity of trials
GENERATIONS, TRIALS, VALIDATION_TRIALS = "optimizer.generations", "trials", "validation.trials"
"""The configuration keys whose values may be raised when a run or an evaluation is resumed."""


def find_growing(values: Mapping[str, Any]) -> str:
    """Return the key whose value may be raised when an evaluation is resumed."""
    return VALIDATION_TRIALS if values.get("evaluation_draws") == VALIDATION else TRIALS


def count_growing(values: Mapping[str, Any], key: str) -> int:
    """Return the value in a nested configuration of a key that may be raised."""
    if key == TRIALS:
        return int(values[TRIALS])
    if key == GENERATIONS:
        return int(values["optimizer"]["generations"])
    return int(max(values["optimizer"]["validation_trials"], values["validation"]["trials"] or 0))


@dataclass(frozen=True)
class Plan:
    """Plans the missions of a run or an evaluation.

    The missions of one trial differ only in their world. Missions with the same key of draws have
    the same failures, noise and generated worlds. Cases of a ``systematic`` failure are dealt to
    the trials of each group of draws without replacement; designs with the same number of sensors
    get the same cases.
    """

    seed: int
    worlds: tuple[str, ...]
    trials: int
    validation_trials: int
    policy: str  # scope in which selection reuses the same draws, one of POLICIES
    most_trials: int = 0  # maximum per design and generation in selection; at least ``trials``
    most_validation_trials: int = 0  # maximum per champion, if larger than ``validation_trials``
    evaluation_draws: str = EVALUATION  # VALIDATION to use the draws of a run's validation
    revalidation_trials: int = 0  # number of trials if ``evaluation_draws`` is VALIDATION
    systematic: SystematicFailure | None = None  # the failure model if it has cases

    def selection(
        self,
        generation: int,
        design_id: int,
        design: Design,
        trials: range | None = None,
        earlier: int = 0,
        cases: Sequence[Case] = (),
    ) -> list[Mission]:
        """Return the missions that determine a design's fitness.

        ``trials`` numbers the trials of this generation (default: the trials of a new design).
        ``earlier`` is the number of trials in earlier generations, whose draws are not reused.
        ``cases`` are the cases of trials 0, 1, and so on.
        """
        individual = f"{generation}:{design_id}"
        groups = {"generation": f"{generation}", "individual": individual, "run": "all"}
        trials = range(self.trials) if trials is None else trials
        skipped = earlier if self.policy == "run" else 0
        about = (generation, design_id, design, SELECTION, groups[self.policy], trials)
        missions = self._missions(*about, skipped + trials.start, skipped)
        if not cases:
            return missions
        return [replace(item, case=cases[item.trial % len(cases)]) for item in missions]

    def validation(
        self, generation: int, design_id: int, design: Design, count: int | None = None
    ) -> list[Mission]:
        """Return missions on fresh draws, which selection never uses and all designs share.

        The trials are numbered after the trials for selection; trials beyond ``validation_trials``
        are numbered after the trials for confirmation.
        """
        count = self.validation_trials if count is None else count
        trials = range(self._selected, self._selected + min(count, self.validation_trials))
        further = range(self._confirmed, self._confirmed + count - len(trials))
        numbers = [*trials, *further]
        return self._missions(generation, design_id, design, VALIDATION, "all", numbers)

    def final(
        self, generation: int, design_id: int, design: Design, trials: range
    ) -> list[Mission]:
        """Return missions of the final choice, on fresh draws that all designs share."""
        after = self._confirmed + max(0, self.most_validation_trials - self.validation_trials)
        numbers = range(after + trials.start, after + trials.stop)
        return self._missions(generation, design_id, design, FINAL, "all", numbers, trials.start)

    def confirmation(
        self,
        generation: int,
        design_id: int,
        design: Design,
        trials: range | None = None,
        earlier: int = 0,
        cases: Sequence[Case] = (),
    ) -> list[Mission]:
        """Return the missions of ``selection`` for another simulator, on the same draws."""
        after = self._selected + self.validation_trials
        return [
            replace(mission, trial=after + mission.trial, purpose=CONFIRMATION)
            for mission in self.selection(generation, design_id, design, trials, earlier, cases)
        ]

    def evaluation(self, generation: int, design_id: int, design: Design) -> list[Mission]:
        """Return a design's missions in an evaluation, on fresh or on validation draws."""
        if self.evaluation_draws == VALIDATION:
            return self.validation(generation, design_id, design, self.revalidation_trials)
        return self._missions(
            generation, design_id, design, EVALUATION, f"{generation}", range(self.trials)
        )

    @property
    def evaluation_trials(self) -> int:
        """The number of missions in an evaluation per design and world."""
        return self.revalidation_trials if self.evaluation_draws == VALIDATION else self.trials

    def stated(
        self,
        design_id: int,
        design: Design,
        number: int,
        repeats: range,
        case: Case | None = None,
        setting: str = "",
    ) -> list[Mission]:
        """Return missions of an evaluation under a case or a setting, on its first draws.

        ``number`` counts the cases and settings from 1. Trial ``MOST_REPEATS * number + repeat``
        uses the draws and the parity of trial ``repeat``.
        """
        missions = self._missions(0, design_id, design, EVALUATION, "0", repeats)
        first = number * MOST_REPEATS
        return [
            replace(item, trial=first + item.trial, case=case, setting=setting) for item in missions
        ]

    @property
    def _selected(self) -> int:  # number of the first trial after selection
        return max(self.trials, self.most_trials)

    @property
    def _confirmed(self) -> int:  # number of the first trial after validation and confirmation
        return 2 * self._selected + self.validation_trials

    def _missions(
        self,
        generation: int,
        design_id: int,
        design: Design,
        purpose: str,
        group: str,
        trials: Sequence[int],
        place: int = 0,
        skipped: int = 0,
    ) -> list[Mission]:
        """Return missions in all worlds, after ``place`` earlier trials of the ``group``."""
        key = f"{self.seed}/{purpose}/{group}"
        cases = islice(self._deal_cases(key, len(design.mounts)), place, None)
        missions = []
        for trial, case in zip(trials, cases, strict=False):
            for world in self.worlds:
                draws = f"{key}/{world}/{skipped + trial}"
                item = Mission(generation, design_id, design, world, trial, purpose, draws, case)
                missions.append(item)
        return missions

    def _deal_cases(self, key: str, sensors: int) -> Iterator[Case | None]:
        if self.systematic is None:
            return repeat(None)
        numbers = deal(key, self.systematic.count_cases(sensors))
        return map(partial(self.systematic.state_case, sensors), numbers)


def count_round(purpose: str, generation: int, trial: int) -> int:
    """Return a mission's round number, whose parity sets the driving direction on some courses.

    Selection counts generations, as the original runs did. Validation and the final choice count
    trials, so that each design drives in both directions. Evaluations count both.
    """
    if purpose in SEARCHING:
        return generation
    return trial if purpose in (VALIDATION, FINAL) else generation + trial


def describe(mission: Mission) -> str:
    """Describe a mission for a message."""
    return (
        f"the mission of design {mission.design_id} in {mission.world}, "
        f"generation {mission.generation}, trial {mission.trial}"
    )
