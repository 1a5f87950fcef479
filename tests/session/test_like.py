"""An evaluation takes over the configuration of a run, and changes what is typed."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest
import yaml
from fixture_types import Capture, Folders, Patch
from helpers import OPTION, USER_PARTS, finished_run, refused, reseal, tiny, vary

from evoros.cli.command import evaluate
from evoros.config.compose import compose
from evoros.terminal.console import DONE

PARTS = ("--config-dir", str(USER_PARTS))
CHANGED = ("seed=3", "trials=2", "robot.drive.max_speed_mps=0.3", "~world.far")
SHORT = ("optimizer.generations=1", "optimizer.population_size=2")


@pytest.fixture(scope="module")
def run(tmp_path_factory: Folders) -> Path:
    return finished_run(tmp_path_factory.mktemp("like") / "run", *CHANGED, *SHORT)


def like(run: Path, folder: Path, *more: str) -> int:
    return evaluate([*PARTS, f"like={run}", f"hydra.run.dir={folder}", *more])


def read(folder: Path) -> dict[str, object]:
    config: dict[str, object] = yaml.safe_load((folder / "config.yaml").read_text())
    return config


@pytest.mark.slow
def test_without_anything_typed_the_champion_meets_its_run_again(run: Path, tmp_path: Path) -> None:
    """Its validation missions are repeated bit for bit, so nothing that decides them is lost."""
    assert like(run, tmp_path / "again", "evaluation_draws=validation") == DONE
    missions = pd.read_csv(run / "missions.csv")
    validated = missions[missions["draws"].str.contains("/validation/")]
    again = pd.read_csv(tmp_path / "again" / "missions.csv")
    assert len(validated)
    columns = list(again.columns[again.columns.get_loc("draws") : -1])  # but the row's own digest
    assert again[columns].equals(validated[columns].reset_index(drop=True))
    assert read(tmp_path / "again") == read(run) | {"evaluation_draws": "validation"}


@pytest.mark.slow
def test_choices_replace_groups_and_keys_change_values(run: Path, tmp_path: Path) -> None:
    typed = ["failure=none", "world/course@world.near.course=square", "seed=5"]
    assert like(run, tmp_path / "changed", *typed) == DONE
    before, now = read(run), read(tmp_path / "changed")
    assert now.pop("failure") == {"_target_": "evoros.failure.none.NoFailure"}
    square = compose(["world=maze"]).values["course"]
    assert now.pop("world")["near"]["course"] == square  # type: ignore[index]
    before.pop("failure"), before.pop("world")
    assert now == before | {"seed": 5, "evaluation_draws": "evaluation"}
    recorded = json.loads((run / "manifest.json").read_text())["choices"]
    choices = json.loads((tmp_path / "changed" / "manifest.json").read_text())["choices"]
    effect = recorded.pop("filter@failure.effect")
    assert effect == "silence"  # of the failure that was replaced, file and all
    assert choices == recorded | {"failure": "none"}


@pytest.mark.slow
def test_each_value_of_a_sweep_is_based_on_the_run(run: Path, tmp_path: Path) -> None:
    typed = [f"like={run}", "failure=none,random", f"hydra.sweep.dir={tmp_path / 'sweep'}"]
    assert evaluate(["-m", *PARTS, *typed]) == DONE
    configs = [read(folder) for folder in sorted((tmp_path / "sweep").iterdir())]
    assert [config["failure"]["_target_"][-9:] for config in configs] == [  # type: ignore[index]
        "NoFailure",
        "omFailure",
    ]
    assert [config["seed"] for config in configs] == [3, 3]


@pytest.fixture
def sweep(run: Path, tmp_path: Path) -> Path:
    """Two runs that differ in their seeds and in a key that an evaluation does not use."""
    shutil.copytree(run, tmp_path / "sweep" / "a")
    vary(run, tmp_path / "sweep" / "b", {"seed": 4, "optimizer.mutation_probability": 0.25})
    return tmp_path / "sweep"


def test_runs_of_a_sweep_must_agree_in_what_is_used_and_not_typed(
    sweep: Path, tmp_path: Path, capsys: Capture
) -> None:
    assert like(sweep, tmp_path / "scores", "seed=9") == DONE
    assert len(pd.read_csv(tmp_path / "scores" / "designs.csv")) == 2
    capsys.readouterr()
    line = refused(lambda: like(sweep, tmp_path / "other"), capsys)
    assert "must agree on seed, which is 3 in a and 4 in b; type seed=" in line
    validation = ["seed=9", "evaluation_draws=validation"]
    line = refused(lambda: like(sweep, tmp_path / "other", *validation), capsys)
    assert "must agree on optimizer.mutation_probability" in line
    assert not (tmp_path / "other").exists()


def mark_stopped(run: Path) -> None:
    status = json.loads((run / "status.json").read_text())
    (run / "status.json").write_text(json.dumps(status | {"state": "stopped"}))
    reseal(run)


def mark_older(run: Path) -> None:
    manifest = json.loads((run / "manifest.json").read_text())
    (run / "manifest.json").write_text(json.dumps(manifest | {"format_version": 0}))
    reseal(run)


def damage(run: Path) -> None:
    config = (run / "config.yaml").read_text()
    (run / "config.yaml").write_text(config.replace("seed: 3", "seed: 4"))


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (shutil.rmtree, "must be the folder of a finished run or a sweep, but contains no run"),
        (mark_stopped, f"its state is stopped; type: evoros resume {{}} {OPTION}"),
        (
            mark_older,
            "format_version must be 1, not 0; use the version of evoros that made the run",
        ),
        (damage, "config.yaml: line "),
    ],
)
def test_what_is_no_whole_finished_run_is_one_line(
    spoil: Callable[[Path], object], said: str, run: Path, tmp_path: Path, capsys: Capture
) -> None:
    shutil.copytree(run, tmp_path / "spoiled")
    spoil(tmp_path / "spoiled")
    line = refused(lambda: like(tmp_path / "spoiled", tmp_path / "scores"), capsys)
    assert said.format(tmp_path / "spoiled") in line
    assert not (tmp_path / "scores").exists()


@pytest.mark.parametrize(
    ("typed", "said"),
    [
        (["experiment=tiny"], "experiment=tiny: cannot be combined with like="),
        (["simulatr=planar"], "simulatr: no such key; did you mean simulator"),
        (["like="], "like=: must be the folder of a run"),
    ],
)
def test_what_does_not_go_with_a_run_is_one_line(
    typed: list[str], said: str, run: Path, tmp_path: Path, capsys: Capture
) -> None:
    folder = [] if typed == ["like="] else [f"like={run}"]
    call = [*PARTS, *folder, *typed, f"hydra.run.dir={tmp_path / 'scores'}"]
    assert said in refused(lambda: evaluate(call), capsys)


@pytest.mark.slow
def test_a_file_that_has_changed_since_the_run_is_told(
    tmp_path: Path, capsys: Capture, monkeypatch: Patch
) -> None:
    monkeypatch.chdir(tmp_path)
    box = "<model name='m'><static>1</static><link name='l'><collision name='c'><geometry><box>"
    end = "</box></geometry></collision></link></model>"
    world = f"<sdf version='1.6'><world name='w'>{box}<size>SIZE</size>{end}</world></sdf>"
    world = world.replace("<link", "<pose>9 9 0 0 0 0</pose><link")
    (tmp_path / "mine.sdf").write_text(world.replace("SIZE", "1 1 1"))
    assert tiny(tmp_path / "run", *SHORT, "~world.far", "world.near.sdf=mine.sdf") == DONE
    capsys.readouterr()
    assert like(tmp_path / "run", tmp_path / "same") == DONE
    assert "has changed since" not in capsys.readouterr().err
    (tmp_path / "mine.sdf").write_text(world.replace("SIZE", "2 1 1"))
    assert like(tmp_path / "run", tmp_path / "changed") == DONE
    assert "world.near has changed since the run, or its path" in capsys.readouterr().err
    assert like(tmp_path / "run", tmp_path / "typed", "world.near.sdf=mine.sdf") == DONE
    assert "has changed since" not in capsys.readouterr().err


def test_the_configuration_that_is_shown_is_that_of_the_run(run: Path, capsys: Capture) -> None:
    assert evaluate([*PARTS, f"like={run}", "trials=7", "--cfg", "job"]) == DONE
    shown = yaml.safe_load(capsys.readouterr().out)
    assert (shown["seed"], shown["trials"], list(shown["world"])) == (3, 7, ["near"])
    assert shown["simulator"]["_target_"] == read(run)["simulator"]["_target_"]  # type: ignore[index]
