"""A search ends at a limit, says so, and goes on under a larger one as if it had never stopped."""

import json
import shlex
import shutil
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from helpers import TINY, everything, finished_run, tiny

from evoros.cli.main import evoros
from evoros.evolution.stop_after import Spent, StopAfter
from evoros.terminal.console import DONE

SIZE = ("optimizer.generations=4", "optimizer.population_size=4")
VARYING = ("evoros.log", "status.json", "manifest.json", "config.yaml", "digests.csv")


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return finished_run(tmp_path_factory.mktemp("runs") / "whole", *SIZE)


@pytest.fixture
def cut(tmp_path: Path) -> Path:
    return finished_run(tmp_path / "cut", *SIZE, "stop_after.generations=2")


def results(folder: Path) -> dict[str, bytes]:
    return {name: text for name, text in everything(folder).items() if name not in VARYING}


def status(folder: Path) -> dict[str, object]:
    read: dict[str, object] = json.loads((folder / "status.json").read_text())
    return read


def costs(folder: Path) -> pd.DataFrame:
    """The missions and simulated time of selection up to the end of each generation."""
    missions = pd.read_csv(folder / "missions.csv")
    groups = missions[missions["purpose"] == "selection"].groupby("generation")["time_s"]
    return groups.agg(["size", "sum"]).cumsum()


def test_a_stopped_run_is_the_beginning_of_the_whole_run(cut: Path, whole: Path) -> None:
    assert (status(cut)["state"], status(cut)["generations_done"]) == ("finished", 2)
    assert status(cut)["reason"] == "stop_after.generations: 2 of 2"
    tables = sorted(path.name for path in (cut / "generations").iterdir())
    assert tables == ["00000.csv", "00001.csv"]
    for name in tables:
        tabled = [(folder / "generations" / name).read_bytes() for folder in (cut, whole)]
        assert tabled[0] == tabled[1]
    assert (cut / "champion" / "certificate.json").is_file()


@pytest.mark.parametrize("limit", ["generations=null", "missions=999999", "simulated_s=1e9"])
def test_under_a_larger_limit_it_ends_as_the_whole_run(limit: str, cut: Path, whole: Path) -> None:
    lift = () if "null" in limit else ("stop_after.generations=null",)
    assert evoros(["resume", str(cut), f"stop_after.{limit}", *lift]) == DONE
    assert results(cut) == results(whole)
    assert status(cut)["reason"] == ""


def test_under_the_same_limit_it_stays(cut: Path) -> None:
    before = results(cut)
    assert evoros(["resume", str(cut)]) == DONE
    assert results(cut) == before


@pytest.mark.parametrize(("column", "key"), [("size", "missions"), ("sum", "simulated_s")])
def test_the_first_generation_that_reaches_the_limit_is_the_last(
    column: str, key: str, whole: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first, second = costs(whole)[column].iloc[:2]
    limit = int(first) + 1
    assert limit <= second
    assert tiny(tmp_path / "cut", *SIZE, f"stop_after.{key}={limit}") == DONE
    reason = f"stop_after.{key}: {second:.12g} of {limit}"
    assert status(tmp_path / "cut")["reason"] == reason
    out = capsys.readouterr().out
    assert f"\nstopped           {reason}; to continue, type: evoros resume" in out
    (typed,) = (
        line.partition("type: evoros ")[2] for line in out.splitlines() if "stopped" in line
    )
    assert evoros(shlex.split(typed)) == DONE
    assert status(tmp_path / "cut")["generations_done"] != 2


def test_a_resumed_run_keeps_the_processor_times(cut: Path) -> None:
    before: Any = status(cut)["processor_s"]
    assert evoros(["resume", str(cut), "stop_after.generations=3"]) == DONE
    after: Any = status(cut)["processor_s"]
    assert (after[:2], len(after)) == (before, 3)
    assert 0.0 < before[0] < before[1] < after[2]
    (cut / "status.json").unlink()  # the times of recorded generations are then unknown
    assert evoros(["resume", str(cut), "stop_after.generations=null"]) == DONE
    assert status(cut)["processor_s"] == []


@pytest.mark.slow
def test_a_repeated_sweep_continues_its_jobs_to_a_larger_limit(tmp_path: Path) -> None:
    words = ["-m", *TINY, "executor=serial", *SIZE, "seed=1", f"hydra.sweep.dir={tmp_path}"]
    for limit in (1, 2):
        more = ("hydra.sweep.subdir=job", f"stop_after.generations={limit}")
        assert evoros([*words, *more]) == DONE
        assert status(tmp_path / "job")["generations_done"] == limit


def test_all_reached_limits_are_raised_by_the_proposed_command(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "cut"
    assert tiny(folder, *SIZE, "stop_after.generations=1", "stop_after.missions=1") == DONE
    reason = str(status(folder)["reason"])
    assert reason.startswith("stop_after.generations: 1 of 1, stop_after.missions: ")
    typed = capsys.readouterr().out.partition(f"{reason}; to continue, type: evoros ")[2]
    assert evoros(shlex.split(typed.splitlines()[0])) == DONE
    assert status(folder)["generations_done"] == 2


def test_each_session_has_its_wall_clock_limit(tmp_path: Path, whole: Path) -> None:
    folder = tmp_path / "cut"
    assert tiny(folder, *SIZE, "stop_after.wall_s=1e-9") == DONE
    assert status(folder)["generations_done"] == 1
    ended = results(folder), status(folder)["reason"]
    assert evoros(["resume", str(folder)]) == DONE
    assert (results(folder), status(folder)["reason"]) == ended
    assert evoros(["resume", str(folder), "stop_after.wall_s=1000"]) == DONE
    assert results(folder) == results(whole)


@pytest.mark.slow
def test_a_stopped_run_can_be_reproduced(cut: Path, tmp_path: Path) -> None:
    assert evoros(["resume", str(cut), "stop_after.generations=3"]) == DONE
    again = tmp_path / "again"
    assert evoros(["reproduce", str(cut), "--output", str(again)]) == DONE
    shutil.rmtree(again / "champion")
    assert evoros(["reproduce", str(cut), "--output", str(again)]) == DONE
    assert status(again)["generations_done"] == 3


@pytest.mark.slow
def test_controls_have_the_size_of_the_stopped_run(tmp_path: Path) -> None:
    folder = tmp_path / "cut"
    words = ("stop_after.missions=5", "controls=all", "controls.trials=2")
    assert tiny(folder, *SIZE, *words) == DONE
    assert evoros(["resume", str(folder)]) == DONE
    done = status(folder)["generations_done"]
    assert status(folder / "controls" / "random")["generations_done"] == done


@pytest.mark.parametrize("spent", [Spent(3, 9, 1.0, 5.0), Spent(1, 10, 99.0, 5.0)])
def test_limits_are_reached_from_their_value_on(spent: Spent) -> None:
    assert StopAfter().find_reached(spent) == ""
    assert StopAfter(missions=spent.missions + 1).find_reached(spent) == ""
    assert StopAfter(missions=spent.missions).find_reached(spent).startswith("stop_after.missions")
