"""Observers get what a run records, in order, and no result depends on them."""

import json
import sys
from pathlib import Path
from typing import Any

import pytest
from fixture_types import Capture, Patch
from helpers import (
    TINY,
    USER_PARTS,
    copied,
    cut,
    everything,
    finished_run,
    refusal,
    refused,
    resume,
    sweep,
    tiny,
)

import evoros as package
from evoros.cli.main import evoros
from evoros.config.recorded import flatten_recorded
from evoros.terminal.console import DONE, INPUT

OBSERVED = "observers=[recorder,meddler]"
OWN = ("--config-dir", str(USER_PARTS))


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: Patch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))


@pytest.fixture
def plain(tmp_path: Path) -> Path:
    return finished_run(tmp_path / "plain")


def sent() -> list[dict[str, Any]]:
    """What the recorder got in the current folder."""
    return [json.loads(line) for line in Path("sent.jsonl").read_text().splitlines()]


def same_files(run: Path) -> dict[str, bytes]:
    """The files that no date is in, and that do not name what observes."""
    varying = ("config.yaml", "manifest.json", "status.json", "evoros.log", "digests.csv")
    return {name: data for name, data in everything(run).items() if name not in varying}


def test_a_run_is_the_same_whatever_observes_it(plain: Path, capsys: Capture) -> None:
    run = Path("observed")
    assert tiny(run, OBSERVED) == DONE
    assert same_files(run) == same_files(plain)
    keys = [json.loads((f / "manifest.json").read_text())["sha256"]["rows"] for f in (run, plain)]
    assert keys[0] == keys[1]
    capsys.readouterr()
    assert evoros(["diff", str(plain), str(run)]) == DONE
    assert capsys.readouterr().out.count("\n") == 1  # not even made with other observers
    assert not Path("changed").exists()


def test_observers_get_each_generation_in_order_and_the_end() -> None:
    assert tiny(Path("run"), OBSERVED) == DONE
    steps, run = sent(), package.load_run("run")
    assert [len(step["generations"]) for step in steps] == [0, 1, 2, 3, 3]
    assert [step["state"] for step in steps] == [None] * 4 + ["finished"]
    last = steps[-1]
    assert last["generations"] == [0, 1, 2]
    for number, table in run.generations.groupby("generation"):
        metrics = last["metrics"][number]
        assert metrics["best_fitness"] == table.fitness.max()
        assert metrics["mean_fitness"] == pytest.approx(table.fitness.mean(), rel=1e-12)
        best = table[table.fitness == table.fitness.max()].validated_fitness
        assert metrics["best_validated_fitness"] == best.max()
    assert last["champion"]["champion.validated_fitness"] == run.status["best_validated_fitness"]
    assert {"champion/design.csv", "champion/certificate.json"} <= set(last["files"])
    recorded = flatten_recorded(run.path / "config.yaml")
    assert last["parameters"]["optimizer.generations"] == recorded["optimizer.generations"]
    assert not any(key.startswith("observers") for key in last["parameters"])


@pytest.mark.slow
def test_a_resumed_and_extended_run_is_continued(tmp_path: Path) -> None:
    assert tiny(tmp_path / "run", OBSERVED) == DONE
    whole = (tmp_path / "run" / "missions.csv").stat().st_size
    cut(tmp_path / "run", whole // 2)
    assert resume(tmp_path / "run") == DONE
    assert resume(tmp_path / "run", "optimizer.generations=4") == DONE
    steps = sent()
    assert len({step["id"] for step in steps}) == 1
    assert [step["generations"] for step in steps if step["state"] == "finished"] == [
        [0, 1, 2],
        [0, 1, 2],
        [0, 1, 2, 3],
    ]
    assert all(step["generations"] == sorted(step["generations"]) for step in steps)


def test_a_resume_may_change_the_observers() -> None:
    run = Path("run")  # of this folder, in which the recorder writes
    assert tiny(run) == DONE
    before = same_files(run)
    assert resume(run, OBSERVED) == DONE
    assert sent()[-1]["generations"] == [0, 1, 2]
    assert same_files(run) == before


@pytest.mark.slow
def test_a_copy_is_the_same_run_and_another_run_is_not(plain: Path, tmp_path: Path) -> None:
    twin = copied(plain, tmp_path / "moved")
    assert tiny(tmp_path / "other", "seed=1") == DONE
    folders = map(str, (plain, twin, tmp_path / "other"))
    assert evoros(["export", *OWN, "recorder", *folders]) == DONE
    first, second, third = (step["id"] for step in sent())
    assert first == second != third


@pytest.mark.slow
def test_a_reproduction_sends_nothing(tmp_path: Path) -> None:
    assert tiny(tmp_path / "run", OBSERVED) == DONE
    before = sent()
    output = ("--output", str(tmp_path / "again"))
    assert evoros(["reproduce", str(tmp_path / "run"), *OWN, *output]) == DONE
    assert sent() == before


@pytest.mark.slow
def test_jobs_of_a_sweep_know_it(tmp_path: Path) -> None:
    assert sweep(tmp_path / "study", "seed=0,1", OBSERVED) == DONE
    assert {step["group"] for step in sent()} == {"study"}
    Path("sent.jsonl").unlink()
    assert evoros(["export", *OWN, "recorder", str(tmp_path / "study")]) == DONE
    assert [step["group"] for step in sent()] == ["study", "study"]
    assert sweep(tmp_path / "study", "seed=0,1") == DONE  # typed again without: complete


def test_a_tracker_that_fails_is_one_warning(
    plain: Path, tmp_path: Path, capsys: Capture, monkeypatch: Patch
) -> None:
    monkeypatch.setenv("TRACKER_API_KEY", "k3y-0f-nob0dy")
    text = "observers.failing.text='https://me:pw0rd@host: k3y-0f-nob0dy is refused'"
    for generation in (0, 2):
        run = tmp_path / f"run_{generation}"
        failing = ("observers=[recorder,failing]", f"observers.failing.generation={generation}")
        capsys.readouterr()
        assert tiny(run, *failing, "observers.failing.text=${oc.env:TRACKER_API_KEY}") == DONE
        (warning,) = [line for line in capsys.readouterr().err.splitlines() if "failing" in line]
        assert "in Failing.send: ConnectionError: ***; the run continues" in warning
        command = f"evoros export failing {run.name} 'text=\"${{oc.env:TRACKER_API_KEY}}\"'"
        assert command in warning
        assert same_files(run) == same_files(plain)
        assert not any(b"k3y-0f-nob0dy" in data for data in everything(run).values())
    assert sent()[-1]["state"] == "finished"  # the other observer goes on
    assert tiny(tmp_path / "address", "observers=failing", text) == DONE
    assert "https://***@host: *** is refused" in capsys.readouterr().err


def test_bad_input_is_one_line(
    plain: Path, tmp_path: Path, capsys: Capture, monkeypatch: Patch
) -> None:
    assert "mlflow" in refusal(tmp_path, capsys, "observers=mlfow")
    assert "observers" in refusal(tmp_path, capsys, "+observers.x=3")
    for package_name, name in (("mlflow",) * 2, ("wandb",) * 2, ("tensorboardX", "tensorboard")):
        monkeypatch.setitem(sys.modules, package_name, None)
        line = refusal(tmp_path, capsys, f"observers={name}")
        assert line.endswith(f"type: pip install 'evoros[{name}]'\n")
        assert refused(lambda name=name: evoros(["export", name, str(plain)]), capsys) == (  # type: ignore[misc]
            line.replace("evoros:", "evoros export:")
        )
    (tmp_path / "empty").mkdir()
    for place in ("empty", "nowhere"):
        line = refused(lambda place=place: evoros(["export", *OWN, "recorder", place]), capsys)  # type: ignore[misc]
        assert line.startswith(f"evoros export: {place}: must be the folder of a run")
    typed = ["export", *OWN, "recorder", "fil=x", str(plain)]
    assert "observers.recorder.file" in refused(lambda: evoros(typed), capsys)
    designs = [f"designs={plain}", f"hydra.run.dir={tmp_path / 'scores'}", "observers=recorder"]
    assert evoros(["evaluate", *TINY, *designs]) == INPUT
    assert "observers: must not be given" in capsys.readouterr().err


def test_damage_is_not_exported(plain: Path, capsys: Capture) -> None:
    table = plain / "generations" / "00001.csv"
    table.write_bytes(table.read_bytes().replace(b"0", b"1", 1))
    line = refused(lambda: evoros(["export", *OWN, "recorder", str(plain)]), capsys)
    assert str(table) in line
    assert not Path("sent.jsonl").exists()
