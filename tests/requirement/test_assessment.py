"""Requirements with levels: rates of wrong verdicts, where trials go, and who decides."""

from collections import Counter
from pathlib import Path
from runpy import run_path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evoros.base.errors import InputError
from evoros.failure.protocol import Case
from evoros.failure.random import RandomFailure
from evoros.failure.spatial import SpatialFailure
from evoros.measure.protocol import Measure
from evoros.mission.mission import COMPLETED, TIME_LIMIT
from evoros.requirement.claim import OWN, Claim, Condition
from evoros.requirement.requirements import (
    ROUND,
    Assessment,
    Survival,
    check_requirements,
    collect,
    list_levels,
)
from evoros.requirement.verdict import (
    MET,
    PERCENT,
    UNDECIDED,
    VIOLATED,
    Trial,
    Verdict,
    conclude,
    write_percent,
)
from evoros.testing.part import DescriptionSuite
from evoros.testing.subjects import example_outcome
from evoros.worst_cases.worst_cases import WorstCases

WORLDS = ["hall", "yard"]
STUDY = run_path(str(Path(__file__).parents[2] / "benchmarks/requirements/levels.py"))
SURVIVAL = Survival(1, times_s=(0.0,))
EACH = Claim("completed", at_least=0.6, each="failed_sensor")


OUTCOMES = {True: (example_outcome(1.0, COMPLETED),), False: (example_outcome(0.5, TIME_LIMIT),)}


def ends(requirement: Any, rates: list[float], runs: int, trials: int = 100) -> Counter[str]:
    rng, draw, simulate = np.random.default_rng(len(rates)), STUDY["draw_values"], STUDY["simulate"]
    drawn = (draw(requirement, rates, 0.95, trials, rng) for _ in range(runs))
    return Counter(simulate(requirement, values)[0] for values in drawn)


def unmeasured(part: Measure, trial: Trial) -> float:
    raise AssertionError("completions need no measure")


@pytest.mark.parametrize("requirement", [SURVIVAL, EACH])
@pytest.mark.parametrize("sensors", [1, 5])
def test_the_study_of_error_rates_decides_as_evaluations_do(requirement: Any, sensors: int) -> None:
    """All three results are among these designs, and some levels end before others."""
    world, trials, found = STUDY["WORLD"], 95, set()
    for seed, weak in enumerate([0.2, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0]):
        rng = np.random.default_rng(seed)
        dead = [weak] + [0.95] * (sensors - 1)
        values = STUDY["draw_values"](requirement, dead, 0.95, trials, rng)
        assessment = Assessment({"one": requirement}, [world], sensors, trials)
        conditions = [one for one in assessment.conditions if one != OWN]
        while not assessment.finished:
            rows = {
                condition: {n: {world: OUTCOMES[bool(row[n])]} for n in range(wanted)}
                for condition, row in zip(conditions, values, strict=True)
                for wanted in [assessment.wanted[condition]]
            }
            assessment.advance({OWN: {}, **rows}, [], unmeasured)
        count = sum(assessment.wanted[condition] for condition in conditions)
        result = assessment.result("one")
        found.add(result)
        assert STUDY["simulate"](requirement, values) == (result, count)
    assert found == {MET, VIOLATED, UNDECIDED}


@pytest.mark.parametrize(("requirement", "limit"), [(SURVIVAL, 0.5), (EACH, 0.6)])
def test_one_sensor_at_the_limit_is_rarely_overlooked(requirement: Any, limit: float) -> None:
    """At most 5 % wrong: of 200, more than 19 would have a chance of 1 in 1000."""
    found = ends(requirement, [limit] + [0.95] * 7, 200)
    assert found[MET] <= 19
    assert found[VIOLATED] <= 19


@pytest.mark.parametrize(("requirement", "limit"), [(SURVIVAL, 0.5), (EACH, 0.6)])
def test_many_sensors_at_the_limit_violate_nothing_by_chance(
    requirement: Any, limit: float
) -> None:
    """Without Bonferroni's correction, more than half of these designs violate it."""
    found = ends(requirement, [limit] * 24, 40, 60)
    assert found[MET] == 0
    assert found[VIOLATED] <= 7  # 5 %; more have a chance of 1 in 1000


@pytest.mark.parametrize("requirement", [SURVIVAL, EACH])
@pytest.mark.parametrize("sensors", [1, 16])
def test_clear_designs_are_decided_as_they_are(requirement: Any, sensors: int) -> None:
    assert ends(requirement, [0.95] * sensors, 20)[MET] >= 19
    assert ends(requirement, [0.15] + [0.95] * (sensors - 1), 20)[VIOLATED] >= 19


def known(assessment: Assessment, fails: Case | None) -> dict[Condition, Any]:
    """Trials in which a case is never completed, and everything else always."""
    return {
        condition: {
            number: {
                world: (
                    example_outcome(0.0, TIME_LIMIT)
                    if condition.case and condition.case == fails
                    else example_outcome(1.0, COMPLETED),
                )
                for world in WORLDS
            }
            for number in range(wanted)
        }
        for condition, wanted in assessment.wanted.items()
    }


def finish(assessment: Assessment, fails: Case | None = None) -> None:
    while not assessment.finished:
        assessment.advance(known(assessment, fails), [], unmeasured)


def test_levels_that_are_decided_get_no_more_trials() -> None:
    claim = Claim("completed", at_least=0.9, each="failed_sensor")
    assessment = Assessment({"one": claim}, WORLDS, 4, 100)
    fatal = Case.of([(2, 0.0)])
    finish(assessment, fatal)
    wanted = {one.text: count for one, count in assessment.wanted.items()}
    assert wanted == {"": ROUND, "0@0.0": 40, "1@0.0": 40, "2@0.0": ROUND, "3@0.0": 40}
    judged = assessment.judge(known(assessment, fatal), [], unmeasured)["one"]
    assert (judged.whole.result, judged.whole.decided_by) == (VIOLATED, "failed_sensor=2@0.0")
    results = {name: verdict.result for name, verdict in judged.levels.items()}
    assert results.pop("failed_sensor=2@0.0") == VIOLATED
    assert set(results.values()) == {MET}
    assert assessment.result("one") == VIOLATED


def test_a_survival_ends_with_the_first_case_that_stops_the_design() -> None:
    survival = Survival(2, stops_below=0.9, times_s=(0.0, 40.0))
    assessment = Assessment({"one": survival}, WORLDS, 3, 100)
    assert len(assessment.conditions) == 1 + 1 + 2 * (3 + 3)  # own, intact, sets by times
    fatal = Case.of([(0, 40.0), (2, 40.0)])
    finish(assessment, fatal)
    assert set(assessment.wanted.values()) == {ROUND}
    whole = assessment.judge(known(assessment, fatal), [], unmeasured)["one"].whole
    assert (whole.result, whole.decided_by) == (VIOLATED, f"{fatal.text} in hall")
    assert (whole.value, whole.worst[1]) == (0.0, "hall")


def test_each_case_is_shown_before_a_survival_is_met() -> None:
    assessment = Assessment({"one": SURVIVAL}, WORLDS, 3, 5)  # one trial too few for any case
    finish(assessment)
    whole = assessment.judge(known(assessment, None), [], unmeasured)["one"].whole
    assert (whole.result, whole.further) == (UNDECIDED, SURVIVAL.fewest_trials - 5)


class TestSurvival(DescriptionSuite):
    part, protocol = Survival(1), Survival


def test_a_survival_fails_sensors_at_the_times_of_the_search_for_worst_cases() -> None:
    search = WorstCases()
    assert (Survival(1).times_s, Survival(1).max_cases) == (search.times_s, search.max_cases)


@pytest.mark.parametrize(("unit", "scale"), [(PERCENT, 100.0), ("", 1.0)])
def test_shares_are_written_in_percent_and_other_numbers_as_they_are(
    unit: str, scale: float
) -> None:
    verdict = Verdict(MET, 8, 0.75, 0.5, 0.875, 0.95, 0.5, unit, (0, "hall"))
    shares = [float(number) / scale for number in verdict._write_numbers()]
    assert shares == pytest.approx([0.75, 0.5, 0.875], abs=0.01)
    assert write_percent(0.125) == "12.5 %"


RESULT = st.sampled_from([MET, VIOLATED, UNDECIDED])


@given(st.dictionaries(st.text(min_size=1), st.tuples(RESULT, st.integers(1, 99)), min_size=1))
def test_the_whole_is_met_by_all_and_violated_by_one(levels: dict[str, tuple[str, int]]) -> None:
    verdicts = {
        name: Verdict(result, count, 0.5, 0.4, 0.6, 0.95, 0.5, PERCENT, (0, "hall"), further=count)
        for name, (result, count) in levels.items()
    }
    results = {verdict.result for verdict in verdicts.values()}
    whole = conclude(verdicts)
    assert (whole.result == MET) == (results == {MET})
    assert (whole.result == VIOLATED) == (VIOLATED in results)
    assert verdicts[whole.decided_by].result == whole.result


def test_the_case_that_would_soonest_violate_it_decides() -> None:
    def verdict(further: float, tends: str) -> Verdict:
        worst = (0, "hall")
        return Verdict(UNDECIDED, 50, 0.5, 0.4, 0.6, 0.95, 0.5, PERCENT, worst, further, tends)

    rising = {"a": verdict(40, MET), "b": verdict(300, MET)}
    assert conclude(rising).decided_by == "b"
    falling = {**rising, "c": verdict(90, VIOLATED), "d": verdict(70, VIOLATED)}
    assert conclude(falling).decided_by == "d"
    assert conclude({**rising, "e": verdict(float("inf"), "")}).decided_by == "e"


def test_levels_follow_the_configuration() -> None:
    def texts(each: Any) -> list[str]:
        claim = Claim("completed", at_least=0.5, each=each)
        return [level.text for level in list_levels(claim, WORLDS, 2)]

    assert texts(None) == [""]
    assert texts("world") == ["world=hall", "world=yard"]
    assert texts({"world": ["yard"]}) == ["world=yard"]
    assert texts("failed_sensor") == ["failed_sensor=0@0.0", "failed_sensor=1@0.0"]
    assert texts({"failed_sensor": [1.0, 9]})[1:3] == ["failed_sensor=0@9.0", "failed_sensor=1@1.0"]
    parts = {"failure": {"one": RandomFailure(), "several": SpatialFailure()}}
    assert texts(parts) == ["failure=one", "failure=several"]


def test_worlds_share_the_trials_of_the_evaluation() -> None:
    claims = {"one": Claim("completed", at_least=0.5, each="world")}
    assessment = Assessment(claims, WORLDS, 2, 100)
    assert assessment.conditions == [OWN]
    assert assessment.list_worlds(OWN) == WORLDS


def test_levels_that_do_not_fit_are_refused_in_one_line() -> None:
    for requirement, sensors, message in (
        (Survival(3), 2, r"requirements\.one\.survives: must be at most 2, .* not 3"),
        (
            Survival(3),
            16,
            r"requirements\.one\.max_cases: must be at least 2089, .* raise max_cases",
        ),
        (
            EACH,
            0,
            r"requirements\.one\.each: the design has no sensor that can fail",
        ),
    ):
        with pytest.raises(InputError, match=message) as error:
            Assessment({"one": requirement}, WORLDS, sensors, 10)
        assert "\n" not in str(error.value)
    with pytest.raises(InputError, match=r"one\.each\.world: must be one of hall, yard, not 'lab'"):
        check_requirements(
            {"one": Claim("completed", at_least=0.5, each={"world": ["lab"]})}, WORLDS, []
        )
    one, other = RandomFailure(count=1), RandomFailure(count=2)
    claims = {
        name: Claim("completed", at_least=0.5, each={"failure": {"some": part}})
        for name, part in (("a", one), ("b", other))
    }
    with pytest.raises(InputError, match=r"requirements\.b\.each: failure=some is also the name"):
        check_requirements(claims, WORLDS, [])


@pytest.mark.parametrize(
    "each", ["sensor", {"failure": {}}, {"world": []}, {"failed_sensor": [-1]}]
)
def test_unknown_factors_and_empty_levels_are_refused(each: Any) -> None:
    with pytest.raises(InputError, match=r"requirements\.mine: Claim\.each: must be failed_sensor"):
        collect(mine={"of": "completed", "at_least": 0.5, "each": each})
