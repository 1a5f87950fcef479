"""Requirements in the tests of a robot's software, about missions as tables."""

import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from helpers import TINY, USER_PARTS

import evoros
from evoros.base.errors import InputError
from evoros.cli.command import evaluate
from evoros.mission.mission import COMPLETED, Mission
from evoros.storage.tables import MISSION_COLUMNS, mission_row, name_outcome_columns
from evoros.terminal.console import DONE
from evoros.testing import require
from evoros.testing.subjects import example_design, example_outcome

DESIGN = "design,sensor,x_m,y_m,yaw_deg\na,0,0.2,0,0\n"


def table(completed: list[bool], worlds: tuple[str, ...] = ("hall",)) -> pd.DataFrame:
    rows = []
    for trial, done in enumerate(completed):
        outcome = replace(example_outcome(1.0, COMPLETED), completed=done)
        for world in worlds:
            mission = Mission(0, 7, example_design(), world, trial, "evaluation", "draws")
            rows.append(mission_row(mission, (outcome,)))
    return pd.DataFrame(rows, columns=[*MISSION_COLUMNS, *name_outcome_columns([])])


def test_what_is_met_passes_and_what_is_not_fails_with_its_numbers() -> None:
    require(table([True] * 80), completed=0.95)
    require(table([True] * 80), soon={"of": "time_s", "at_most": 90, "share": 0.9})
    with pytest.raises(AssertionError, match=r"design 7 violated: completed in at .* 95 % .*; 0 %"):
        require(table([False] * 5), completed=0.95)
    with pytest.raises(AssertionError, match=r"design 7 undecided: .* worst mission is trial 1"):
        require(table([True, False, True]), completed=0.5)


def test_trials_count_in_the_order_of_their_numbers() -> None:
    """Tables are sorted by the world."""
    made = table([False] * 3 + [True] * 60, ("hall", "maze")).sort_values(["world", "trial"])
    with pytest.raises(AssertionError, match=r"violated: .* in 2 trials"):
        require(made, completed=0.95)


def test_no_mission_is_an_error() -> None:
    with pytest.raises(InputError, match="missions: the table is empty"):
        require(table([]), completed=0.5)
    with pytest.raises(InputError, match="require: no requirements are given"):
        require(table([True] * 80))
    with pytest.raises(InputError, match=r"missions: must be a table of missions or the"):
        require(pd.DataFrame({"design": [0], "near_completed": [1.0]}), completed=0.5)
    with pytest.raises(InputError, match=r"requirements\.complete\.of: must be a measure or"):
        require(table([True]), complete={"of": "complete", "at_least": 0.5, "share": 0.5})


@pytest.mark.slow
def test_missions_of_an_evaluator_and_of_a_folder_are_the_same(tmp_path: Path) -> None:
    (tmp_path / "one.csv").write_text(DESIGN)
    typed = [*TINY, "executor=serial", f"designs={tmp_path / 'one.csv'}", "trials=20"]
    assert evaluate([*typed, f"hydra.run.dir={tmp_path / 'scored'}"]) == DONE
    read = pd.read_csv(tmp_path / "scored" / "missions.csv")
    config = ["experiment=tiny", "executor=serial", "trials=20"]
    require(read, time_s={"of": "time_s", "at_least": 0, "share": 0.8})
    with pytest.raises(AssertionError, match="design a violated"):
        require(read, time_s={"of": "time_s", "at_most": 1, "share": 0.8})
    with evoros.Evaluator(config, config_dir=USER_PARTS) as evaluator:
        design = evaluator.space.decode(np.full(evaluator.space.size, 0.5))
        missions = evaluator.missions([design])
    require(missions, time_s={"of": "time_s", "at_least": 0, "share": 0.8})


def test_what_evaluate_returns_is_accepted() -> None:
    config = ["experiment=tiny", "executor=serial", "trials=20", "~world.far"]
    with evoros.Evaluator(config, config_dir=USER_PARTS) as evaluator:
        designs = [evaluator.space.decode(np.full(evaluator.space.size, 0.5))]
        scored, none = evaluator.evaluate(designs), evaluator.evaluate([])
    require(scored, completed=0.8)
    with pytest.raises(AssertionError, match=r"design 0 violated: .* at most 1 in "):
        require(scored, time_s={"of": "time_s", "at_most": 1, "share": 0.8})
    assert list(scored["near_completed"]) == [scored.missions["completed"].mean()] == [1.0]
    again = pickle.loads(pickle.dumps(scored))
    pd.testing.assert_frame_equal(again.missions, scored.missions)
    with pytest.raises(InputError, match="missions: the table is empty"):
        require(none, completed=0.5)
    with pytest.raises(InputError, match="but has no column world"):
        require(scored[scored["design"] == 0], completed=0.5)  # a plain table
