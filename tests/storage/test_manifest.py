import json
import shutil
import tomllib
from collections.abc import Sequence
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest
from helpers import ROOT, USER_PARTS, everything, finished_run, reseal
from packaging.requirements import Requirement

from evoros.base.errors import InputError
from evoros.cli.command import evaluate
from evoros.cli.main import evoros
from evoros.config.compose import compose
from evoros.files.origin import read_origin
from evoros.simulator.protocol import PlacedRobot, Simulator
from evoros.storage.circumstances import COMPUTING
from evoros.storage.manifest import manifest, mission_packages
from evoros.terminal.console import DONE, INPUT
from evoros.world.model import World

ONE = ["experiment=tiny", "executor=serial", "optimizer.generations=1"]


@pytest.fixture
def parts(tmp_path: Path) -> Path:
    """A user's folder that may be edited, with a module of a name of its own."""
    copy = tmp_path / "own"
    shutil.copytree(USER_PARTS, copy, ignore=shutil.ignore_patterns("__pycache__"))
    name = f"planar_{abs(hash(str(tmp_path)))}"
    (copy / "planar.py").rename(copy / f"{name}.py")
    for file in copy.rglob("*.yaml"):
        file.write_text(file.read_text().replace("planar.P", f"{name}.P"))
    return copy


@pytest.mark.slow
def test_a_users_module_that_has_changed_is_refused(
    parts: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run, (module,) = tmp_path / "run", parts.glob("planar_*.py")
    assert evoros(["--config-dir", str(parts), *ONE, f"hydra.run.dir={run}"]) == DONE
    recorded = json.loads((run / "manifest.json").read_text())["sha256"]
    assert {key for key in recorded if key.startswith("module ")} == {f"module {module.stem}"}
    again = ["resume", str(run), "--config-dir", str(parts)]
    assert evoros(again) == DONE
    before = everything(run)
    module.write_text(module.read_text() + "\n# another thought\n")
    capsys.readouterr()
    assert evoros(again) == INPUT
    err = capsys.readouterr().err
    assert f"module {module.stem} has changed since the run began" in err
    assert err.count("\n") == 1
    assert everything(run) == before


@pytest.mark.slow
def test_the_executors_module_may_change_for_no_result_depends_on_it(
    parts: Path, tmp_path: Path
) -> None:
    (parts / "mine_exec.py").write_text("from evoros.executor.serial import Serial\n")
    run = tmp_path / "run"
    arguments = ["--config-dir", str(parts), *ONE, "executor._target_=mine_exec.Serial"]
    assert evoros([*arguments, f"hydra.run.dir={run}"]) == DONE
    (parts / "mine_exec.py").write_text("from evoros.executor.serial import Serial  # faster\n")
    assert evoros(["resume", str(run), "--config-dir", str(parts)]) == DONE
    assert evoros(["resume", str(run), "--config-dir", str(parts), "executor=serial"]) == DONE


@pytest.mark.parametrize(
    ("chosen", "named"),
    [
        (["simulator=planar"], set()),
        (["simulator=pybullet"], {"pybullet"}),
        (["simulator=planar", "confirmation=physics"], {"mujoco-core"}),
    ],
)
def test_the_versions_of_engines_come_from_the_simulators(
    chosen: list[str], named: set[str]
) -> None:
    config = compose([*chosen, "executor=serial"])
    experiment = config.build()
    assert set(mission_packages(experiment)) == {*COMPUTING, *named}
    versions = manifest(experiment, config.text, config.values, config.choices)["packages"]
    assert {*COMPUTING, *named} <= set(versions)
    installed = {name: told for name, told in versions.items() if told and name != "evoros"}
    assert installed == {name: version(name) for name in installed}


def test_a_run_tells_what_it_was_made_with(tmp_path: Path) -> None:
    finished_run(tmp_path / "run", "optimizer.generations=1")
    recorded = json.loads((tmp_path / "run" / "manifest.json").read_text())
    origin = read_origin()
    assert [recorded[key] for key in ("commit", "dirty")] == [origin.commit, origin.dirty]
    assert recorded["packages"]["evoros"] == origin.version
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    required = {Requirement(text).name for text in project["dependencies"]}
    assert required <= set(recorded["packages"])
    assert all(recorded[key] for key in ("python", "operating_system", "processor"))


def test_what_a_users_optimizer_imports_is_recorded_and_compared(
    parts: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its library, imported late, and a module beside it with a library of its own."""
    helper = f"helper_{abs(hash(str(tmp_path)))}"
    search = f"from evoros.optimizer.random_search import RandomSearch\nimport {helper}\n"
    (parts / f"my_{helper}.py").write_text(f"{search}def late():\n    import cma\n")
    (parts / f"{helper}.py").write_text("from mpmath.libmp import backend\nimport json\n")
    run = tmp_path / "run"
    target = f"optimizer._target_=my_{helper}.RandomSearch"
    chosen = ["optimizer=random_search", "~optimizer.mutation_probability", target]
    common = ["--config-dir", str(parts), *ONE, *chosen]
    assert evoros([*common, f"hydra.run.dir={run}"]) == DONE
    recorded = json.loads((run / "manifest.json").read_text())
    assert recorded["packages"]["cma"] == version("cma")
    assert recorded["packages"]["mpmath"] == version("mpmath")
    assert "json" not in recorded["packages"]
    assert {f"module {helper}", f"module my_{helper}"} <= set(recorded["sha256"])
    (parts / f"{helper}.py").write_text("another = 1\n")
    assert evoros(["resume", str(run), "--config-dir", str(parts)]) == INPUT
    assert f"module {helper} has changed since" in capsys.readouterr().err


def test_a_simulator_that_names_no_packages_is_refused_in_one_line() -> None:
    class Silent(Simulator):
        time_step = 0.05

        def open(self, robots: Sequence[PlacedRobot], world: World) -> Any:
            """Open nothing."""

    experiment = compose(["executor=serial"]).build()
    with pytest.raises(InputError, match=r"^Scenario\.simulator: .*time_step, packages and"):
        replace(experiment, simulator=Silent())


def test_other_versions_are_said_on_the_terminal_and_in_the_log(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = tmp_path / "run"
    assert evoros(["--config-dir", str(USER_PARTS), *ONE, f"hydra.run.dir={run}"]) == DONE
    recorded = json.loads((run / "manifest.json").read_text())
    assert set(recorded["packages"]) >= {*COMPUTING, "lxml"}
    recorded["packages"] |= {"numpy": "0.1", "numba": None, "lxml": "0.2"}
    (run / "manifest.json").write_text(json.dumps(recorded))
    reseal(run)
    assert "0.1" not in (run / "evoros.log").read_text()
    capsys.readouterr()
    assert evoros(["resume", str(run), "--config-dir", str(USER_PARTS)]) == DONE
    log = (run / "evoros.log").read_text()
    for said in (capsys.readouterr().err, log):
        assert "numpy was 0.1 when the run was recorded, and is now " in said
        assert "numba was not installed when the run was recorded, and is now " in said
        assert "lxml" not in said
        assert "evoros was" not in said
    assert log.count("numpy was 0.1") == 1


@pytest.mark.slow
def test_the_choices_of_groups_are_recorded_of_runs_and_evaluations(tmp_path: Path) -> None:
    choices = ["failure=spatial", "filter@failure.effect=stuck"]
    run, scores = tmp_path / "run", tmp_path / "scores"
    common = ["--config-dir", str(USER_PARTS), *ONE, *choices]
    assert evoros([*common, f"hydra.run.dir={run}"]) == DONE
    assert evaluate([*common, f"hydra.run.dir={scores}", f"designs={run}"]) == DONE
    for folder in (run, scores):
        recorded = json.loads((folder / "manifest.json").read_text())["choices"]
        assert {"failure": "spatial", "filter@failure.effect": "stuck"}.items() <= recorded.items()
        assert recorded["experiment"] == "tiny"
        assert not any(group.startswith("hydra") for group in recorded)
