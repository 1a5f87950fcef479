"""Sweeps whose jobs the real launchers and sweepers of Hydra start."""

import json
import shutil
from pathlib import Path

import pytest
import yaml
from fixture_types import Capture, Folders
from helpers import TINY, content, everything

from evoros.cli.main import evoros
from evoros.terminal.console import DONE, INPUT, STOPPED


def launch(folder: Path, *more: str, generations: int = 1) -> int:
    options = ["executor=serial", f"optimizer.generations={generations}"]
    return evoros(["-m", *TINY, *options, f"hydra.sweep.dir={folder}", *more])


def runs_of(sweep: Path) -> dict[str, dict[str, str]]:
    """What must be the same for every launcher, by the seed of the run."""
    return {run.name.rpartition("-")[2]: content(run) for run in sweep.glob("experiment-*")}


@pytest.fixture(scope="module")
def expected(tmp_path_factory: Folders) -> dict[str, dict[str, str]]:
    sweep = tmp_path_factory.mktemp("own") / "sweep"
    assert launch(sweep, "seed=0,1") == DONE
    return runs_of(sweep)


@pytest.mark.slow
@pytest.mark.parametrize("launcher", ["joblib", "submitit_local"])
def test_a_launcher_makes_the_same_folders_and_a_bad_job_stops_the_sweep(
    launcher: str, expected: dict[str, dict[str, str]], tmp_path: Path, capfd: Capture
) -> None:
    """And it goes on with a sweep that has begun."""
    sweep, chosen = tmp_path / "a sweep", f"hydra/launcher={launcher}"
    assert launch(sweep, "seed=-2,0", chosen) == INPUT
    assert not sweep.exists()
    assert launch(sweep, "seed=0") == DONE
    before = {name: text for name, text in everything(sweep).items() if "seed-0" in name}
    assert launch(sweep, "seed=0,1", chosen) == DONE
    assert runs_of(sweep) == expected
    now = everything(sweep)
    assert {name: now[name] for name in before} == before
    err = capfd.readouterr().err
    assert err.count("seed: must be a non-negative integer, not -2") == 1
    assert "Traceback" not in err


@pytest.mark.slow
def test_a_sweeper_sees_the_validated_fitness_of_the_champion(
    tmp_path: Path, capsys: Capture
) -> None:
    sweep = tmp_path / "sweep"
    options = ["hydra/sweeper=optuna", "hydra.sweeper.n_trials=3", "hydra.sweeper.sampler.seed=1"]
    space = "optimizer.mutation_probability=interval(0.05,0.9)"
    options += [space, "hydra.sweeper.direction=maximize"]
    assert launch(sweep, *options, generations=2) == DONE
    validated = {
        json.loads(path.read_text())["best_validated_fitness"]
        for path in sweep.glob("*/status.json")
    }
    assert len(validated) > 1
    results = yaml.safe_load((sweep / "optimization_results.yaml").read_text())
    assert results["best_value"] == max(validated)
    assert "searches for the lowest" not in capsys.readouterr().err


@pytest.mark.slow
def test_a_sweeper_that_looks_for_the_worst_is_noted(tmp_path: Path, capsys: Capture) -> None:
    options = ["hydra/sweeper=optuna", "hydra.sweeper.n_trials=1", "seed=choice(-1,-2)"]
    assert launch(tmp_path / "sweep", *options) == INPUT
    err = capsys.readouterr().err
    assert "for the highest, add hydra.sweeper.direction=maximize" in err
    assert "evoros: seed: must be a non-negative integer" in err


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("srun") is not None, reason="needs a system without Slurm")
def test_a_launcher_that_cannot_work_says_why(tmp_path: Path, capsys: Capture) -> None:
    assert launch(tmp_path / "sweep", "seed=0,1", "hydra/launcher=submitit_slurm") == STOPPED
    (line,) = [line for line in capsys.readouterr().err.splitlines() if "srun" in line]
    assert line.startswith("evoros: hydra/launcher=submitit_slurm: ")
    assert "run the sweep without the plugin" in line


@pytest.mark.parametrize(
    ("choice", "package"),
    [("launcher=rq", "hydra-rq-launcher"), ("sweeper=ax", "hydra-ax-sweeper")],
)
def test_a_plugin_that_is_not_installed_is_named(
    choice: str, package: str, tmp_path: Path, capsys: Capture
) -> None:
    assert launch(tmp_path / "sweep", "seed=0,1", f"hydra/{choice}") == INPUT
    assert f"pip install {package}" in capsys.readouterr().err
