"""Failures that evolve against the designs of a run."""

from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from helpers import USER_PARTS, content, copied, cut, resume
from hypothesis import given
from hypothesis import strategies as st

import evoros
from evoros.base.errors import InputError
from evoros.base.rng import generator
from evoros.cli.main import evoros as command
from evoros.failure.adversarial import AdversarialFailure
from evoros.failure.combined import CombinedFailure
from evoros.failure.exhaustive import ExhaustiveFailure
from evoros.failure.protocol import AdaptiveFailure, Case
from evoros.terminal.console import DONE

ADVERSARIAL = ["failure=adversarial", "failure.fame=1", "trials=4"]


@given(st.integers(0, 9), st.integers(1, 9), st.integers(1, 4), st.integers(0, 3), st.integers())
def test_cases_stay_within_their_bounds_whatever_the_scores(
    sensors: int, trials: int, most: int, fame: int, seed: int
) -> None:
    model = AdversarialFailure(most=most, earliest_s=5.0, latest_s=9.0, fame=fame)
    assert isinstance(model, AdaptiveFailure)
    first, second = (model.start(sensors, trials, generator("any", f"{seed}")) for _ in range(2))
    luck = generator("scores", f"{seed}")
    for _ in range(6):
        cases = first.list_cases()
        assert len(cases) == trials
        for case in cases:
            assert len(case.sensors) <= min(most, sensors)
            assert bool(case.sensors) == (sensors > 0)
            assert all(0 <= sensor < sensors for sensor in case.sensors)
            assert all(5.0 <= time <= 9.0 for time in case.times_s)
        met = {i: luck.permutation(trials)[: int(luck.random() * (trials + 1))] for i in range(3)}
        scores = {i: {int(place): float(luck.random()) for place in met[i]} for i in met}
        assert second.list_cases() == cases  # the same scores give the same cases
        first.tell(scores)
        second.tell(scores)


def test_what_harms_designs_prevails() -> None:
    def score(case: Case) -> float:  # late failures of sensor 3 are the worst
        return -case.times_s[case.sensors.index(3)] if 3 in case.sensors else 0.0

    adversary = AdversarialFailure(most=2).start(6, 8, generator("any", "adversary"))
    for _ in range(40):
        cases = adversary.list_cases()
        scores = {place: score(case) for place, case in enumerate(cases)}
        adversary.tell({1: scores, 2: {place: 10.0 + value for place, value in scores.items()}})
    last = adversary.list_cases()
    assert sum(3 in case.sensors for case in last) >= 6
    assert min(map(score, last)) < -75.0


def test_a_mutant_gains_loses_moves_or_retimes_a_failure_equally_often() -> None:
    adversary: Any = AdversarialFailure(most=3).start(4, 1, generator("any", "mutants"))
    case, kinds = Case.of([(0, 50.0), (1, 60.0)]), Counter[str]()
    for _ in range(1200):
        sensors = adversary._mutate(case).sensors
        kept = "retimed" if sensors == case.sensors else "moved"
        kinds[{1: "lost", 2: kept, 3: "gained"}[len(sensors)]] += 1
    assert all(abs(count - 300) < 75 for count in kinds.values())  # five standard deviations
    assert len(kinds) == 4


def test_it_is_validated_by_drawn_failures_alone() -> None:
    with pytest.raises(InputError, match=r"failure.validation: .* ExhaustiveFailure"):
        AdversarialFailure(validation=ExhaustiveFailure())
    with pytest.raises(InputError, match=r"failure.failures.foe: .* AdversarialFailure"):
        CombinedFailure({"foe": AdversarialFailure()})


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("adversarial") / "run"
    keys = ["simulator=bicycle", "world=plains", "figures=[]", *ADVERSARIAL]
    small = ["optimizer.generations=4", "optimizer.population_size=4"]
    typed = ["--config-dir", str(USER_PARTS), *keys, *small, "optimizer.validation_trials=1"]
    more = ["failure.earliest_s=2", "failure.latest_s=8", f"hydra.run.dir={folder}"]
    assert command([*typed, *more, "executor=serial"]) == DONE
    return folder


@pytest.mark.slow
def test_designs_of_a_generation_meet_the_same_cases_and_validation_draws(run: Path) -> None:
    missions = evoros.load_run(run).missions
    selected = missions[missions["purpose"] == "selection"]
    others = missions[missions["purpose"] != "selection"]
    assert selected["case"].notna().all()
    assert others["case"].isna().all()
    assert (selected.groupby(["generation", "trial"])["case"].nunique() == 1).all()
    by_generation = selected.groupby("generation")["case"].agg(frozenset)
    assert by_generation.nunique() > 1


@pytest.mark.slow
def test_resuming_on_two_workers_changes_nothing(run: Path, tmp_path: Path) -> None:
    other = copied(run, tmp_path / "run")
    cut(other, (other / "missions.csv").stat().st_size // 3)
    assert resume(other, "executor=processes", "executor.workers=2") == DONE
    assert content(other) == content(run)


def test_a_recorded_mission_is_replayed_under_its_case(run: Path) -> None:
    missions = evoros.load_run(run).missions
    row = missions[missions["failed_sensors"].notna()].iloc[-1].to_dict()
    key = (int(row["generation"]), int(row["design"]), str(row["world"]), int(row["trial"]))
    (outcome,), _ = evoros.replay(run, key, config_dir=USER_PARTS)
    assert list(outcome.failed_sensors) == [int(float(row["failed_sensors"]))]
    assert outcome.progress == row["progress"]
