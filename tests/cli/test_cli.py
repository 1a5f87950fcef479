import json
import re
import shutil
import signal
import time
from pathlib import Path

import pytest
from fixture_types import Capture, Patch
from helpers import (
    OPTION,
    TINY,
    USER_PARTS,
    content,
    everything,
    finished_run,
    resume,
    start,
    tiny,
    wait_for_missions,
)

from evoros.cli.main import evoros
from evoros.cli.reporting import Interrupts
from evoros.files.resources import bundled_folder
from evoros.terminal.console import DONE, INPUT, INTERRUPTED, STOPPED

BAD = [
    (["foo=1"], "foo: no such key"),
    (
        ["worst_cases.x=1"],
        "worst_cases.x: not in the configuration; to add it, type +worst_cases.x=",
    ),
    (["hydra.sweeper.params.seed=0"], "hydra.sweeper.params.seed=0: allowed only in"),
    (["+foo=1"], "unknown key 'foo'"),
    (["robot=nix"], "robot: must be one of courier, coyote, erle_rover"),
    (["failure=null"], "failure: must be one of"),
    (["optimizer=[1]"], "optimizer: must be one of"),
    (["controller.avoidance.rang_m=1"], "did you mean controller.avoidance.range_m"),
    (
        ["controller.avoidance.range_m=-1"],
        "controller.avoidance.range_m: must be a positive number",
    ),
    (["+controller.avoidance.rang=1"], "controller.avoidance: unknown key 'rang'"),
    (["controller.period_s=0.033"], "controller.period_s: must be a whole multiple of"),
    (["design.sensors.sonar.period_s=0.033"], "design.sensors.sonar.period_s: must be a whole"),
    (["seed=x"], "seed: must be a non-negative integer"),
    (["seed=[1"], "must be key=value"),
    ([""], "must be key=value"),
    (["seed"], "must be key=value"),
    (["seed=${oc.env:EVOROS_NO_SUCH}"], "seed: "),
    (["trials=${nothing}"], "trials: "),
    (["seed=0,1"], "add -m"),
    (["world.near.sdf=nix.sdf"], "world.near: nix.sdf: no such file"),
    (["robot.description=nix.urdf"], "robot: nix.urdf: no such file"),
    (["robot.drive.steering_joints=[a,b]"], "there is no joint 'a'"),
    (["world.near.course.waypoints=[[5,0],[3,0]]"], "inside the obstacle 'unit_box_1'"),
    (["design.regions.front.x_m=[2,3]"], "design.regions.front"),
    (["optimizer._target_=nix.Nix"], "a folder given with --config-dir, not nix.Nix"),
    (
        ["optimizer._target_=evoros.base.rng.Nix"],
        "optimizer._target_: the module evoros.base.rng has no Nix",
    ),
    (["population_size=3"], "did you mean optimizer.population_size"),
    (["~fitness._target_"], "fitness: must be a fitness function (a subclass"),
    (
        ["+design.genes.a={key: controller.period_s, low: 0, high: 1}"],
        "add _target_ with the class",
    ),
    (["fitness._target_=builtins.dict"], "fitness._target_: must be a class in evoros or in a"),
    (
        ["fitness._target_=evoros.files.disk.os.getcwd"],
        "evoros.files.disk.os.getcwd is not the class of a part",
    ),
    (["+_partial_=true"], "_target_: must be evoros.evolution.experiment.Experiment"),
    (["--nix"], "unrecognized arguments: --nix"),
    (["--config-name=x"], "--config-name"),
    (["--config-dir"], "expected one argument"),
    (["hydra.run.dir=/proc/nix/run"], "/proc/nix/run: cannot be created"),
    (["hydra.run.dir=a/${oc.env:EVOROS_NO_SUCH}"], "hydra.run.dir: KeyError"),
    (["-m", "hydra.sweep.dir=a/${nothing}", "seed=0,1"], "hydra.sweep.dir: Interpolation"),
    (["-m", "hydra.sweep.subdir=a${nothing}", "seed=0,1"], "hydra.sweep.subdir: Interpolation"),
]


@pytest.mark.parametrize(("arguments", "said"), BAD, ids=[" ".join(a) for a, _ in BAD])
def test_bad_input_is_one_clear_line_and_leaves_no_folder(
    arguments: list[str], said: str, tmp_path: Path, monkeypatch: Patch, capsys: Capture
) -> None:
    monkeypatch.chdir(tmp_path)
    assert evoros([*TINY, *arguments]) == INPUT
    out, err = capsys.readouterr()
    assert out == ""
    assert re.fullmatch(r"evoros: [^\n]+\n", err)
    assert said in err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("file", "text", "said"),
    [
        ("simulator/mine.yaml", "a: [1\nb: 2", "mine.yaml"),
        ("simulator/mine.yaml", "_target_: broken.Broken", "broken.py, line 1: invalid syntax"),
        ("simulator/mine.yaml", "_target_: failing.Failing", "ZeroDivisionError"),
        (
            "simulator/mine.yaml",
            "_target_: leaving.Leaving",
            "leaving.py, line 1, in <module>: Sys",
        ),
        (
            "simulator/mine.yaml",
            "defaults: [nix]",
            "simulator/nix: file not found for the defaults of simulator/mine",
        ),
    ],
)
def test_bad_files_of_the_user_are_one_clear_line(
    file: str, text: str, said: str, tmp_path: Path, capsys: Capture
) -> None:
    mine = tmp_path / "own"
    (mine / file).parent.mkdir(parents=True)
    (mine / file).write_text(text)
    (mine / "broken.py").write_text("def (:")
    (mine / "leaving.py").write_text("raise SystemExit(0)")
    (mine / "failing.py").write_text("class Failing:\n    def __init__(self): 1 / 0")
    run = tmp_path / "run"
    arguments = ["--config-dir", str(mine), "simulator=mine", f"hydra.run.dir={run}"]
    assert evoros(arguments) == INPUT
    err = capsys.readouterr().err
    assert re.fullmatch(r"evoros: [^\n]+\n", err)
    assert said in err
    assert not run.exists()


def test_broken_xml_is_one_clear_line(tmp_path: Path, capsys: Capture) -> None:
    (tmp_path / "bad.sdf").write_text("<sdf version='1.6'><world></sdf>")
    assert tiny(tmp_path / "run", f"world.near.sdf={tmp_path / 'bad.sdf'}") == INPUT
    err = capsys.readouterr().err
    assert re.fullmatch(r"evoros: world\.near[^\n]*bad\.sdf[^\n]*line 1[^\n]*\n", err)


@pytest.mark.slow
def test_a_folder_that_is_not_empty_is_refused_untouched(tmp_path: Path, capsys: Capture) -> None:
    run = finished_run(tmp_path / "a run")
    before = everything(run)
    capsys.readouterr()
    assert tiny(run, "seed=1") == INPUT
    assert f"evoros resume '{run}'" in capsys.readouterr().err
    assert everything(run) == before

    (tmp_path / "notes").mkdir()
    (tmp_path / "notes" / "mine.txt").write_text("mine")
    assert tiny(tmp_path / "notes") == INPUT
    assert everything(tmp_path / "notes") == {"mine.txt": b"mine"}

    (tmp_path / "empty").mkdir()
    assert tiny(tmp_path / "empty", "optimizer.generations=1") == DONE


@pytest.mark.slow
def test_a_sweep_names_its_folders_and_starts_nothing_if_a_job_is_bad(
    tmp_path: Path, capsys: Capture
) -> None:
    sweep = tmp_path / "sweep"
    arguments = [*TINY, "executor=serial", f"hydra.sweep.dir={sweep}", "optimizer.generations=1"]
    for swept, told in (
        (["failure=spatial,random,nix", "seed=0,-1"], "failure: must be one of"),
        (["failure=spatial,random", "seed=0,-1"], "seed: must be a non-negative integer"),
    ):
        assert evoros(["-m", *arguments, *swept]) == INPUT
        assert told in capsys.readouterr().err
        assert not sweep.exists()
    assert evoros(["-m", *arguments, "failure=spatial,random", "seed=0"]) == DONE
    name = "experiment-tiny_executor-serial_generations-1_failure-{}_seed-0"
    expected = {name.format("spatial"), name.format("random")}
    assert {path.name for path in sweep.iterdir()} == expected  # nothing of Hydra's


@pytest.mark.slow
def test_names_that_look_alike_get_folders_of_their_own(tmp_path: Path, monkeypatch: Patch) -> None:
    sweep = tmp_path / "sweep"
    for name in ("a b", "a-b"):
        shutil.copy(bundled_folder("worlds") / "boxes.sdf", tmp_path / f"{name}.sdf")
    monkeypatch.chdir(tmp_path)
    arguments = [*TINY, "executor=serial", f"hydra.sweep.dir={sweep}", "optimizer.generations=1"]
    assert evoros(["-m", *arguments, "world.near.sdf='a b.sdf','a-b.sdf'"]) == DONE
    assert len(list(sweep.iterdir())) == 2


def test_the_case_study_is_thirty_runs_and_what_is_typed_comes_first() -> None:
    from evoros.config.jobs import Job, Jobs

    jobs = Jobs(["experiment=case_study"], False, None)
    assert len(jobs) == 30
    assert jobs.sweep is not None
    one = Jobs(["experiment=case_study", "failure=spatial", "seed=3,4"], False, None)
    folders = [job.folder.name for job in one if isinstance(job, Job)]
    assert folders == [
        "experiment-case_study_failure-spatial_seed-3",
        "experiment-case_study_failure-spatial_seed-4",
    ]


def test_no_secret_reaches_the_disk(tmp_path: Path, monkeypatch: Patch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("EVOROS_SECRET", "13572468")
    assert evoros([*TINY, "executor=serial", "seed=${oc.env:EVOROS_SECRET}"]) == INPUT
    assert list(tmp_path.iterdir()) == []
    assert (
        evoros(
            [
                *TINY,
                "executor=serial",
                "optimizer.generations=1",
                "failure.latest_s='${oc.decode:${oc.env:EVOROS_SECRET}}'",
            ]
        )
        == DONE
    )
    (run,) = (tmp_path / "outputs").iterdir()
    assert "13572468" not in run.name
    assert "EVOROS_SECRET" in (run / "config.yaml").read_text()
    assert all(b"13572468" not in content for content in everything(run).values())
    assert list(json.loads((run / "manifest.json").read_text())["secrets"]) == ["failure.latest_s"]


def test_help_explains_and_version_is_ours(capsys: Capture) -> None:
    assert evoros(["--help"]) == DONE
    text = capsys.readouterr().out
    for word in (
        "resume FOLDER",
        "-m",
        "--config-dir",
        "Exit status",
        "failure: adversarial, ",
        "130",
    ):
        assert word in text
    assert "Hydra" not in text
    assert max(map(len, text.splitlines())) <= 100
    assert evoros(["--version"]) == DONE
    assert capsys.readouterr().out.startswith("evoros ")


@pytest.mark.slow
def test_an_exception_in_a_worker_stops_the_run_which_can_be_resumed(
    tmp_path: Path, capsys: Capture
) -> None:
    run, mark, folder = tmp_path / "run", tmp_path / "mark", tmp_path / "it's, mine=1"
    folder.symlink_to(USER_PARTS, target_is_directory=True)
    faulty = ["simulator.fault=raise", f"simulator.mark={mark}"]
    processes = ["executor=processes", "executor.workers=1", "executor.retries=0"]
    given = ["--config-dir", str(folder), "experiment=tiny", f"hydra.run.dir={run}"]
    assert evoros([*given, *processes, *faulty]) == STOPPED
    err = capsys.readouterr().err
    last = err.strip().splitlines()[-1]
    assert "in far, generation 0, trial 0: ZeroDivisionError: the planar fault" in last
    assert "planar.py, line " in last
    assert (
        "; correct the code and start a new run" in last
    )  # resuming would refuse a corrected part
    assert f"(traceback in {run / 'evoros.log'})" in last
    assert "Traceback" not in err
    assert "planar.py" in (run / "evoros.log").read_text()
    assert json.loads((run / "status.json").read_text())["state"] == "stopped"
    assert resume(run, "executor=serial") == DONE

    assert content(run) == content(finished_run(tmp_path / "whole"))


@pytest.mark.slow
def test_a_mission_that_is_lost_once_is_tried_again(tmp_path: Path) -> None:
    run = tmp_path / "run"
    lost = ["simulator.fault=exit", f"simulator.mark={tmp_path / 'mark'}"]
    processes = ["executor=processes", "executor.workers=1"]
    assert tiny(run, *lost, *processes, "optimizer.generations=1") == DONE
    assert content(run) == content(finished_run(tmp_path / "sound", "optimizer.generations=1"))


@pytest.mark.slow
def test_a_lost_mission_stops_the_run_or_is_the_worst_where_asked(
    tmp_path: Path, capsys: Capture
) -> None:
    short = ["executor=processes", "executor.workers=1", "executor.retries=0"]
    short += ["optimizer.generations=1", "optimizer.population_size=2", "simulator.fault=exit"]
    short += ["optimizer.validation_trials=0"]
    assert tiny(tmp_path / "stop", *short) == STOPPED
    assert "in far, generation 0, trial 0" in capsys.readouterr().err
    assert tiny(tmp_path / "worst", *short, "lost_missions=worst") == DONE
    rows = (tmp_path / "worst" / "missions.csv").read_text().splitlines()[1:]
    far = [row for row in rows if ",far," in row]
    assert far
    assert all(",lost," in row for row in far)


@pytest.mark.slow
def test_a_failure_of_the_simulation_is_the_worst_with_a_reason(tmp_path: Path) -> None:
    assert tiny(tmp_path / "run", "simulator.fault=fail") == DONE
    rows = (tmp_path / "run" / "missions.csv").read_text().splitlines()[1:]
    failed = [row for row in rows if "simulation_failure" in row]
    assert failed
    assert all("said “no”" in row for row in failed)
    before = content(tmp_path / "run")
    assert resume(tmp_path / "run") == DONE
    assert content(tmp_path / "run") == before


@pytest.mark.slow
def test_a_signal_ends_a_sweep_cleanly_and_says_how_to_go_on(
    tmp_path: Path, capsys: Capture
) -> None:
    fast = tmp_path / "fast"
    slowly = ["simulator.pause_s=5", f"simulator.mark={fast}"]  # no job ends before the signal
    arguments = ["-m", *TINY, "executor.workers=2", *slowly, "seed=0,1,2"]
    name = "hydra.sweep.subdir=seed-${seed}"
    process = start([*arguments, "hydra.sweep.dir=sweep", name], tmp_path)
    begun = [tmp_path / "sweep" / f"seed-{seed}" for seed in (0, 1)]
    for run in begun:
        wait_for_missions(run, 1)
    process.send_signal(signal.SIGTERM)
    _, err = process.communicate()
    fast.touch()
    assert process.returncode == STOPPED
    assert "hydra.sweep.dir=sweep" in err
    assert "Traceback" not in err
    assert resume(tmp_path / "sweep") == INPUT
    assert "repeat the command of its sweep" in capsys.readouterr().err
    assert {path.name for path in (tmp_path / "sweep").iterdir()} == {path.name for path in begun}
    for seed, run in enumerate(begun):
        assert f"evoros resume {run.relative_to(tmp_path)} {OPTION}" in err
        assert json.loads((run / "status.json").read_text())["reason"] == "interrupted"
        assert resume(run, "executor=serial") == DONE
        assert content(run) == content(finished_run(tmp_path / f"alone {seed}", f"seed={seed}"))


@pytest.mark.slow
def test_ctrl_c_again_until_the_process_ends_changes_nothing(tmp_path: Path) -> None:
    """It comes amid the orderly end, and then while the interpreter joins threads and workers."""
    options = ["executor.workers=1", "simulator.pause_s=0.1", "hydra.run.dir=run"]
    process = start([*TINY, *options], tmp_path)
    wait_for_missions(tmp_path / "run", 1)
    while process.poll() is None:
        process.send_signal(signal.SIGINT)
        time.sleep(0.03)
    _, err = process.communicate()
    assert process.returncode == INTERRUPTED
    assert err.splitlines()[-1].startswith("evoros: interrupted; to continue, type: evoros resume")
    assert resume(tmp_path / "run", "executor=serial") == DONE


def test_an_orderly_end_that_hangs_is_ended_by_another_signal(monkeypatch: Patch) -> None:
    statuses: list[int] = []
    monkeypatch.setattr("os._exit", statuses.append)
    with Interrupts():
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)
        assert statuses == []
        monkeypatch.setattr("evoros.cli.reporting.PATIENCE_S", -1.0)
        signal.raise_signal(signal.SIGINT)
    assert statuses == [INTERRUPTED]
