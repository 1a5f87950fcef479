"""Each suite passes a right part, and names the check that a faulty part fails."""

from collections.abc import Callable
from functools import partial
from typing import Any

import faulty_parts as parts
import pytest
from bundled_parts import configured

from evoros.testing import (
    AllocationSuite,
    DescriptionSuite,
    ExecutorSuite,
    FailureSuite,
    FilterSuite,
    FitnessSuite,
    LayerSuite,
    LiveControllerSuite,
    MeasureSuite,
    OptimizerSuite,
    RangeSensorSuite,
    RegionSuite,
    SimulatorSuite,
)


def list_failures(suite: type[DescriptionSuite], part: Any) -> dict[str, str]:
    """The checks that a part fails, with their messages."""
    failures = {}
    for name in dir(suite):
        if name.startswith("test_"):
            checks = suite()
            checks.part = part
            try:
                getattr(checks, name)()
            except Exception as error:
                failures[name.removeprefix("test_")] = str(error)
    return failures


RIGHT = [
    (FilterSuite, parts.Dazzle),
    (FailureSuite, parts.Front),
    (FitnessSuite, parts.Careful),
    (LayerSuite, parts.Blind),
    (LiveControllerSuite, parts.Ahead),
    (RangeSensorSuite, partial(configured, "sensor", "sonar")),
    (OptimizerSuite, partial(configured, "optimizer", "random_search")),
    (AllocationSuite, partial(configured, "allocation", "once")),
    (MeasureSuite, partial(configured, "measure", "cost")),
    (ExecutorSuite, partial(configured, "executor", "serial")),
    (RegionSuite, lambda: configured("design", "around").regions["front"]),
    (SimulatorSuite, partial(configured, "simulator", "planar")),
]


@pytest.mark.parametrize(("suite", "make"), RIGHT, ids=[suite.__name__ for suite, _ in RIGHT])
def test_a_right_part_passes(suite: type[DescriptionSuite], make: Callable[[], Any]) -> None:
    assert list_failures(suite, make()) == {}


FAULTY = [
    (FilterSuite, parts.Remembers(), "uses_share_no_state"),
    (FilterSuite, parts.ByTheClock(), "the_clock_does_not_matter"),
    (FilterSuite, parts.BySeconds(), "the_clock_does_not_matter"),
    (FilterSuite, parts.ByGlobalLuck(), "global_random_generators_do_not_matter"),
    (FilterSuite, parts.ChangesOnset(), "arguments_stay_as_they_are"),
    (FilterSuite, parts.Early(), "values_before_the_onset_stay_untouched"),
    (FilterSuite, parts.Shifts(), "a_channel_does_not_shift_the_draws_of_another"),
    (FilterSuite, parts.Allocates(), "compiled_rules_allocate_nothing"),
    (FilterSuite, parts.DiffersCompiled(), "compiled_rules_give_the_bits_of_interpreted_ones"),
    (FilterSuite, parts.Raises(), "compiled_rules_give_the_bits_of_interpreted_ones"),
    (FilterSuite, parts.FillsSilence(), "lasting_silence_stays_silent"),
    (FilterSuite, parts.Unchecked(), "bad_values_are_refused_in_one_line"),
    (FilterSuite, parts.RaisesValueError(), "bad_values_are_refused_in_one_line"),
    (FilterSuite, parts.Anonymous(), "name_and_effect_can_be_recorded"),
    (FilterSuite, parts.Thawed(), "it_is_a_frozen_dataclass"),
    (FilterSuite, parts.Keeps(), "fields_stay_as_they_are"),
    (FilterSuite, parts.HoldsFunction(), "it_pickles"),
    (FilterSuite, parts.Front(), "it_has_what_its_kind_has"),
    (FailureSuite, parts.ShortOnset(), "faults_cover_all_sensors"),
    (FailureSuite, parts.NanOnset(), "faults_cover_all_sensors"),
    (FitnessSuite, parts.NanScore(), "scores_are_finite"),
    (FitnessSuite, parts.RewardsLoss(), "a_trial_that_was_not_run_is_worst"),
    (FitnessSuite, parts.Sorts(), "arguments_stay_as_they_are"),
    (LayerSuite, parts.CommandsNan(), "commands_are_finite"),
    (LayerSuite, parts.ChangesReadings(), "arguments_stay_as_they_are"),
    (LiveControllerSuite, parts.AnswersNan(), "its_answers_are_finite"),
    (LiveControllerSuite, parts.UnknownMode(), "its_answers_are_finite"),
    (LiveControllerSuite, parts.ZeroesReadings(), "arguments_stay_as_they_are"),
    (LiveControllerSuite, parts.LostFile(), "its_files_exist"),
    (LiveControllerSuite, parts.WithoutModes(), "its_modes_and_period_are_possible"),
    (OptimizerSuite, parts.BeyondTheCube(), "it_asks_for_new_genomes_of_the_cube_and_tables_them"),
    (OptimizerSuite, parts.AlwaysTheSame(), "another_generator_gives_another_search"),
    (AllocationSuite, parts.Mean(), "trials_are_within_bounds"),
]


@pytest.mark.parametrize(
    ("suite", "part", "check"), FAULTY, ids=[type(part).__name__ for _, part, _ in FAULTY]
)
def test_a_fault_fails_its_check(suite: type[DescriptionSuite], part: Any, check: str) -> None:
    assert check in list_failures(suite, part)
