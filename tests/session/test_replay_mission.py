import subprocess
import sys
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from fixture_types import Capture
from helpers import TINY, USER_PARTS, finished_run, refused, reseal, tiny

from evoros import load_run, replay
from evoros.base.errors import InputError
from evoros.cli.command import evaluate
from evoros.cli.main import evoros
from evoros.terminal.console import DIFFERENT, DONE


@pytest.mark.slow
def test_users_parts_are_found_again_in_a_fresh_process(tmp_path: Path) -> None:
    run = finished_run(tmp_path / "run", "optimizer.generations=2")
    row = load_run(run).missions.iloc[-1]
    place = f"({row.generation}, {row.design}, {row.world!r}, {row.trial})"
    flown = (
        f"outcomes, track = evoros.replay({str(run)!r}, {place}, config_dir={str(USER_PARTS)!r})"
    )
    longer = (
        f"evoros.resume({str(run)!r}, ['optimizer.generations=3'], config_dir={str(USER_PARTS)!r})"
    )
    lost = f"try: evoros.resume({str(run)!r})\nexcept evoros.InputError as error: print(error)"
    code = f"import evoros\n{lost}\n{flown}\nprint(outcomes[0].time_s)\n{longer}"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, stdout=subprocess.PIPE, text=True, check=True
    )
    refused, time_s = done.stdout.splitlines()[:2]
    assert "add --config-dir with the folder that contains the module planar" in refused
    assert float(time_s) == row.time_s
    assert load_run(run).generations["generation"].max() == 2


@pytest.mark.slow
def test_every_mission_of_a_run_is_replayed_as_recorded(tmp_path: Path) -> None:
    run = tmp_path / "run"
    assert tiny(run, "simulator.fault=fail", "optimizer.generations=1") == DONE
    for row in load_run(run).missions.itertuples():
        key: Any = (row.generation, row.design, row.world, row.trial)
        (outcome,), track = replay(run, key)
        assert (outcome.ended, outcome.time_s) == (row.ended, row.time_s)
        assert track.empty == (row.ended == "simulation_failure")


def test_a_mission_that_is_not_there_is_refused(tmp_path: Path) -> None:
    finished_run(tmp_path / "run", "optimizer.generations=1")
    with pytest.raises(InputError, match=r"copy the values from missions.csv"):
        replay(tmp_path / "run", (0, 0, "nix", 0))


def test_a_row_is_replayed_by_as_many_columns_as_choose_it(tmp_path: Path, capsys: Capture) -> None:
    run, track = finished_run(tmp_path / "run", "optimizer.generations=1"), tmp_path / "track.csv"
    typed = ["replay", str(run), "design=0", "world=near", "trial=0", *TINY[:2]]
    assert evoros([*typed, "--output", str(track)]) == DONE
    row = load_run(run).missions.query("design == 0 and world == 'near' and trial == 0").iloc[0]
    printed = {line[:28].strip(): line[28:] for line in capsys.readouterr().out.splitlines()}
    assert (printed["ended"], float(printed["time_s"])) == (row.ended, row.time_s)
    _, trajectory = replay(run, (0, 0, "near", 0), config_dir=USER_PARTS)
    pd.testing.assert_frame_equal(pd.read_csv(track), trajectory, check_dtype=False)
    for columns, told in (
        (["design=0"], "missions with design=0; to choose one, add "),
        (["design=99"], "no mission with design=99; copy"),
        (["desing=0"], "no column desing; copy"),
        ([], "missions; to choose one, add "),
    ):
        assert told in refused(partial(evoros, ["replay", str(run), *columns]), capsys)


def test_a_mission_that_ends_otherwise_than_recorded_is_told(
    tmp_path: Path, capsys: Capture
) -> None:
    """As if another version of evoros had made the run."""
    run = finished_run(tmp_path / "run", "optimizer.generations=1")
    file = run / "missions.csv"
    header, *rows = file.read_text().splitlines()
    cells = rows[0].split(",")
    place = header.split(",").index("collisions")
    cells[place] = str(int(cells[place]) + 1)
    file.write_text("\n".join([header, ",".join(cells), *rows[1:], ""]))
    reseal(run)
    row = dict(zip(header.split(","), cells, strict=True))
    columns = [f"{name}={row[name]}" for name in ("generation", "design", "world", "trial")]
    assert evoros(["replay", str(run), *columns, *TINY[:2]]) == DIFFERENT
    assert "differs from the recorded one" in capsys.readouterr().out


def test_a_mission_of_an_evaluation_is_replayed_on_the_draws_of_a_validation(
    tmp_path: Path,
) -> None:
    (tmp_path / "one.csv").write_text("design,sensor,x_m,y_m,yaw_deg\na,0,0.2,0,0\n")
    draws = ["evaluation_draws=validation", "optimizer.validation_trials=2"]
    places = [f"designs={tmp_path / 'one.csv'}", f"hydra.run.dir={tmp_path / 'scored'}"]
    assert evaluate([*TINY, "executor=serial", *places, *draws]) == DONE
    trials = sorted(set(pd.read_csv(tmp_path / "scored" / "missions.csv")["trial"]))
    for trial in trials:  # of either direction
        columns = ["world=near", f"trial={trial}"]
        assert evoros(["replay", str(tmp_path / "scored"), *columns, *TINY[:2]]) == DONE
