import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from helpers import USER_PARTS, finished_run, tiny

from evoros import load_run, replay
from evoros.base.errors import InputError
from evoros.terminal.console import DONE


def in_a_fresh_process(code: str, cwd: Path) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        [sys.executable, "-c", f"import evoros\n{code}"],
        cwd=cwd,
        capture_output=True,
        text=True,
        check=False,
    )


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
    printed = "print(outcomes[0].time_s, len(track))"
    done = in_a_fresh_process(f"{flown}\n{printed}\n{longer}", tmp_path)
    assert done.returncode == 0, done.stderr
    assert float(done.stdout.split()[0]) == row.time_s
    assert load_run(run).generations["generation"].max() == 2
    done = in_a_fresh_process(f"evoros.resume({str(run)!r})", tmp_path)
    assert "add --config-dir with the folder of its module planar" in done.stderr


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
    with pytest.raises(InputError, match=r"take the values from missions.csv"):
        replay(tmp_path / "run", (0, 0, "nix", 0))
