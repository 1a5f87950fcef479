"""Sweeps that are typed again or started by launchers of Hydra, and the table of all folders."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml
from fixture_types import Capture, Folders
from helpers import TINY, content, cut, everything, resume, scored, sweep, tiny

from evoros.cli.command import evaluate
from evoros.cli.main import evoros
from evoros.cli.status import status
from evoros.session.status import survey
from evoros.storage.layout import seal_json
from evoros.storage.run_folder import RunFolder
from evoros.storage.verification import is_complete
from evoros.terminal.console import DONE, INPUT, STOPPED

NAME = "experiment-tiny_executor-serial_generations-2_seed-{}"


@pytest.fixture(scope="module")
def finished(tmp_path_factory: Folders) -> Path:
    folder = tmp_path_factory.mktemp("finished") / "sweep"
    assert sweep(folder, "seed=0,1,2") == DONE
    return folder


@pytest.fixture
def copy(finished: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(finished, tmp_path / "sweep"))


@pytest.mark.slow
def test_what_is_complete_stays_what_is_begun_goes_on_and_what_is_new_runs(
    finished: Path, copy: Path, capsys: Capture
) -> None:
    runs = [copy / NAME.format(seed) for seed in range(4)]
    kept = everything(runs[0])
    cut(runs[1], (runs[1] / "missions.csv").stat().st_size // 2)
    (runs[1] / "status.json").write_text(
        seal_json("status.json", {"state": "stopped", "reason": "a kill"})
    )
    shutil.rmtree(runs[2])
    assert sweep(copy, "seed=0,1,2,3") == DONE
    assert everything(runs[0]) == kept
    for run in runs[1:3]:
        assert content(run) == content(finished / run.name)
    rows = [line.split() for line in capsys.readouterr().out.splitlines()]
    states = {row[0]: row[1] for row in rows if row and row[0].startswith("experiment-tiny")}
    assert states == dict(zip((run.name for run in runs), ["kept", *["finished"] * 3], strict=True))


@pytest.mark.slow
def test_figures_that_were_not_drawn_are_drawn(tmp_path: Path) -> None:
    assert sweep(tmp_path / "sweep", "seed=0", "figures=[fitness]") == DONE
    (run,) = (tmp_path / "sweep").iterdir()
    before = content(run)
    for file in (run / "figures").iterdir():
        file.unlink()
    assert sweep(tmp_path / "sweep", "seed=0", "figures=[fitness]") == DONE
    assert any((run / "figures").glob("fitness.*"))
    assert content(run) == before


def test_another_run_is_not_touched(copy: Path, capsys: Capture) -> None:
    before = everything(copy)
    subdir = "hydra.sweep.subdir='" + NAME.format("${seed}") + "'"
    assert sweep(copy, "seed=0,1", "trials=2", subdir) == INPUT
    assert everything(copy) == before
    err = capsys.readouterr().err
    assert err.count("must have the configuration of its job, but trials is 2, but was 1") == 2


@pytest.mark.slow
@pytest.mark.parametrize("name", ["missions.csv", "generations/00001.csv", "champion/design.csv"])
def test_a_finished_run_with_a_damaged_table_is_mended_with_a_word(
    name: str, finished: Path, copy: Path, capsys: Capture
) -> None:
    run = copy / NAME.format(1)
    lines = (run / name).read_bytes().splitlines(keepends=True)
    (run / name).write_bytes(b"".join([*lines[:1], lines[1].replace(b"0", b"1"), *lines[2:]]))
    assert sweep(copy, "seed=1") == DONE
    assert f"{run / name}: line 2: damaged" in capsys.readouterr().err
    assert content(run) == content(finished / run.name)


DIGESTS: dict[str, Callable[[list[bytes]], list[bytes]]] = {
    "cut": lambda rows: [*rows[:-1], rows[-1][:-9]],
    "a row is lost": lambda rows: [*rows[:2], *rows[3:]],
    "in another order": lambda rows: [rows[0], *rows[:0:-1]],
    "junk follows": lambda rows: [*rows, b"junk"],
}


@pytest.mark.parametrize("how", DIGESTS)
def test_a_finished_run_whose_digests_are_damaged_is_not_complete(how: str, copy: Path) -> None:
    run = copy / NAME.format(1)
    assert is_complete(run)
    rows = (run / "digests.csv").read_bytes().splitlines(keepends=True)
    (run / "digests.csv").write_bytes(b"".join(DIGESTS[how](rows)))
    assert not is_complete(run)


def test_a_finished_run_that_lacks_a_file_gets_it_again(copy: Path) -> None:
    before = everything(copy)
    (copy / NAME.format(1) / "setting.json").unlink()
    assert sweep(copy, "seed=0,1") == DONE
    free = ("evoros.log", "status.json")
    after = {name: text for name, text in everything(copy).items() if not name.endswith(free)}
    assert after == {name: text for name, text in before.items() if not name.endswith(free)}


def test_a_damaged_configuration_is_not_taken_for_another_one(copy: Path, capsys: Capture) -> None:
    path = copy / NAME.format(0) / "config.yaml"
    path.write_text(path.read_text().replace("trials: 1", "trials: 2"))
    before = everything(copy)
    assert sweep(copy, "seed=0,1") == INPUT
    assert everything(copy) == before
    assert f"{path}: line " in capsys.readouterr().err


@pytest.mark.slow
def test_the_executor_may_change(copy: Path) -> None:
    subdir = "hydra.sweep.subdir='" + NAME.format("${seed}") + "'"
    run = copy / NAME.format(1)
    before = content(run)
    cut(run, (run / "missions.csv").stat().st_size // 2)
    (run / "status.json").unlink()
    assert sweep(copy, "seed=1", "executor=processes", "executor.workers=1", subdir) == DONE
    assert content(run) == before


def test_a_folder_with_other_files_stops_the_sweep_before_it_starts(
    copy: Path, capsys: Capture
) -> None:
    for seed in (0, 1):
        shutil.rmtree(copy / NAME.format(seed))
    foreign = copy / NAME.format(0)
    foreign.mkdir()
    (foreign / "notes.txt").write_text("mine")
    before = everything(copy)
    assert sweep(copy, "seed=0,1") == INPUT
    assert everything(copy) == before
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("evoros: seed=0 (1 of 2 jobs; no job was started): ")


@pytest.mark.slow
def test_evaluations_go_on_if_their_designs_are_the_same(tmp_path: Path, capsys: Capture) -> None:
    for seed in (0, 1):
        assert tiny(tmp_path / f"run{seed}", "optimizer.generations=1", f"seed={seed}") == DONE
    designs = tmp_path / "designs"
    shutil.copytree(tmp_path / "run0", designs)
    options = ["-m", *TINY, "executor=serial", f"designs={designs}", "failure=spatial,random"]
    options.append(f"hydra.sweep.dir={tmp_path / 'sweep'}")
    assert evaluate(options) == DONE
    before = everything(tmp_path / "sweep")
    assert evaluate(options) == DONE
    assert everything(tmp_path / "sweep") == before
    assert resume(min((tmp_path / "sweep").iterdir()), "trials=2") == DONE
    before = everything(tmp_path / "sweep")
    assert evaluate(options) == DONE  # with more trials than asked for, it is complete
    assert everything(tmp_path / "sweep") == before
    shutil.rmtree(designs)
    shutil.copytree(tmp_path / "run1", designs)
    assert evaluate(options) == INPUT
    assert everything(tmp_path / "sweep") == before
    assert capsys.readouterr().err.count("designs: have changed since the evaluation in") == 2


# ---- the table of all folders


def test_the_table_has_all_folders_and_why_they_stopped(copy: Path, capsys: Capture) -> None:
    reason = {"state": "stopped", "reason": "the disk is full", "generations": 2}
    (copy / NAME.format(1) / "status.json").write_text(seal_json("status.json", reason))
    assert status([str(copy)]) == DONE
    header, *rows = capsys.readouterr().out.splitlines()
    assert header.split()[:3] == ["folder", "state", "done"]
    assert [row.split()[:3] for row in rows[:3]] == [
        [NAME.format(0), "finished", "2/2"],
        [NAME.format(1), "stopped", "0/2"],
        [NAME.format(2), "finished", "2/2"],
    ]
    assert rows[3:] == [f"{NAME.format(1)}: the disk is full"]
    assert status([str(copy / "nothing")]) == INPUT
    assert status(["--sometimes"]) == INPUT


def test_an_evaluation_has_its_designs(finished: Path, tmp_path: Path) -> None:
    overview = survey(scored(tmp_path / "scored", finished))
    assert (overview.state, overview.done, overview.wanted) == ("finished", 3, 3)


def test_a_killed_process_is_told_from_one_that_runs(copy: Path) -> None:
    run = copy / NAME.format(0)
    status = json.loads((run / "status.json").read_text())
    silent = {**status, "state": "running", "updated": "2020-01-01T00:00:00+00:00"}
    (run / "status.json").write_text(seal_json("status.json", silent))
    assert survey(run).state == "killed"
    with RunFolder(run):
        assert survey(run).state == "running"


@pytest.mark.parametrize("text", ["", "[1]", "{", '{"missions": "many", "updated": 5}'])
def test_a_damaged_status_hides_no_folder(text: str, copy: Path) -> None:
    (copy / NAME.format(0) / "status.json").write_text(text)
    assert survey(copy / NAME.format(0)).state == "begun"
    assert status([str(copy), "--once"]) == DONE


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
