"""Plan the missions that score a design, with the keys of their random draws."""

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
SEARCHING = (SELECTION, CONFIRMATION)  # purposes of the missions on which a search depends
ACTIVITIES = {
    **dict.fromkeys((SELECTION, EVALUATION), ""),
    CONFIRMATION: "confirming",
    VALIDATION: "validating",
    FINAL: "choosing the champion",
}
"""The activity that the progress line shows, by purpose; empty: the default."""
POLICIES = ("generation", "individual", "run")
STOP, WORST = "stop", "worst"
MOST_REPEATS = 1_000_000  # exceeds the trials of any case or setting; even, to keep the parity
GENERATIONS, TRIALS, VALIDATION_TRIALS = "optimizer.generations", "trials", "validation.trials"
"""The configuration keys whose values may increase when a run or an evaluation is resumed."""


def find_growing(values: Mapping[str, Any]) -> str:
    """Return the key whose value may increase when an evaluation is resumed."""
    return VALIDATION_TRIALS if values.get("evaluation_draws") == VALIDATION else TRIALS


def count_growing(values: Mapping[str, Any], key: str) -> int:
    """Return the value of a growing key in a nested configuration."""
    if key == TRIALS:
        return int(values[TRIALS])
    if key == GENERATIONS:
        return int(values["optimizer"]["generations"])
    return int(max(values["optimizer"]["validation_trials"], values["validation"]["trials"] or 0))


@dataclass(frozen=True)
class Plan:
    """Plans the missions of a run or an evaluation.

    The missions of one trial differ only in their world. Missions whose keys of draws are equal
    have the same failures, noise and generated worlds. Cases of a ``systematic`` failure are dealt
    to the trials of each group of draws without replacement; designs with the same number of
    sensors meet the same cases.
    """

    seed: int
    worlds: tuple[str, ...]
    trials: int
    validation_trials: int
    policy: str  # one of POLICIES: the scope in which selection uses the same draws
    most_trials: int = 0  # maximum per design and generation in selection, if above ``trials``
    most_validation_trials: int = 0  # maximum per champion, if above ``validation_trials``
    evaluation_draws: str = EVALUATION  # VALIDATION: use the draws of a run's validation
    revalidation_trials: int = 0  # number of trials if ``evaluation_draws`` is VALIDATION
    systematic: SystematicFailure | None = None  # failure model, if it has cases

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

        ``trials`` numbers the trials of this generation, by default a new design's trials.
        ``earlier`` counts trials in earlier generations, whose draws are not repeated. With
        ``cases``, trial 0 meets the first case, trial 1 the second, and so on.
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
        """Return missions on fresh draws, which no selection uses and all designs share.

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
        """Return missions of the final choice on fresh draws, which all designs share."""
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
        """Return a design's missions in an evaluation, with fresh draws or VALIDATION's."""
        if self.evaluation_draws == VALIDATION:
            return self.validation(generation, design_id, design, self.revalidation_trials)
        return self._missions(
            generation, design_id, design, EVALUATION, f"{generation}", range(self.trials)
        )

    @property
    def evaluation_trials(self) -> int:
        """The number of missions per design and world in an evaluation."""
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
        """Return an evaluation's missions with a case or a setting, on its first draws.

        ``number`` numbers the cases and settings from 1. Trial ``MOST_REPEATS * number + repeat``
        has the draws and the parity of the evaluation's trial ``repeat``.
        """
        missions = self._missions(0, design_id, design, EVALUATION, "0", repeats)
        first = number * MOST_REPEATS
        return [
            replace(item, trial=first + item.trial, case=case, setting=setting) for item in missions
        ]

    @property
    def _selected(self) -> int:  # the number that follows the trials for selection
        return max(self.trials, self.most_trials)

    @property
    def _confirmed(self) -> int:  # ... and for validation and confirmation
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
        """Return missions in all worlds; ``place`` trials of the ``group`` came earlier."""
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
    """Return a mission's round number, whose parity sets the direction of some courses.

    Selection counts generations, as in the original runs; validation and the final choice count
    trials, so each design drives in both directions; evaluations count both.
    """
    if purpose in SEARCHING:
        return generation
    return trial if purpose in (VALIDATION, FINAL) else generation + trial


def describe(mission: Mission) -> str:
    """Return a mission's name for a message."""
    return (
        f"the mission of design {mission.design_id} in {mission.world}, "
        f"generation {mission.generation}, trial {mission.trial}"
    )
