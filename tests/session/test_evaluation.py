import json
import re
import shutil
import signal
import tracemalloc
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from fixture_types import Capture, Folders, Patch
from helpers import (
    OPTION,
    ROOT,
    TINY,
    USER_PARTS,
    everything,
    reseal,
    resume,
    start,
    tiny,
    wait_for_missions,
)

import evoros
from evoros.base.errors import InputError
from evoros.cli.command import evaluate
from evoros.config.compose import compose
from evoros.design.design import Design
from evoros.dispatch import dispatcher
from evoros.evolution.experiment import Experiment
from evoros.mission.mission import Mission, Outcome
from evoros.session.design_tables import write_designs
from evoros.session.given_designs import read_given
from evoros.storage import run_folder
from evoros.storage.champion_files import DESIGN_COLUMNS, design_table
from evoros.storage.creation import create_folder
from evoros.terminal.console import DONE, INPUT, STOPPED

HEADER = "design,sensor,x_m,y_m,yaw_deg"
TWO = f"{HEADER}\nb,0,0.2,0,0\nb,1,0.2,0.05,30\n7,0,0.1,0,-60\n"


def scored(folder: Path, designs: object, *more: str) -> int:
    return evaluate(
        [*TINY, "executor=serial", f"hydra.run.dir={folder}", f"designs={designs}", *more]
    )


def content(folder: Path) -> dict[str, bytes]:
    """What must be the same for any number of workers and any interruption."""
    missions = sorted((folder / "missions.csv").read_bytes().splitlines())
    names = ("designs.csv", "designs_in.csv", "genes_in.csv", "config.yaml")
    return {"missions.csv": b"\n".join(missions)} | {n: (folder / n).read_bytes() for n in names}


def table(folder: Path) -> pd.DataFrame:
    return pd.read_csv(folder / "designs.csv", dtype={"design": str})


@pytest.fixture(scope="module")
def file(tmp_path_factory: Folders) -> Path:
    path = tmp_path_factory.mktemp("given") / "two.csv"
    path.write_text(TWO)
    return path


@pytest.fixture(scope="module")
def whole(file: Path, tmp_path_factory: Folders) -> Path:
    folder = tmp_path_factory.mktemp("whole") / "scores"
    assert scored(folder, file, "trials=3") == DONE
    return folder


@pytest.fixture(scope="module")
def run(tmp_path_factory: Folders) -> Path:
    """A run whose designs have another evolved value."""
    folder = tmp_path_factory.mktemp("run") / "evolved"
    gene = (
        "{_target_: evoros.design.genes.Gene, key: controller.avoidance.range_m, low: 1, high: 2}"
    )
    assert tiny(folder, f"+design.genes.reach={gene}", "optimizer.generations=1") == DONE
    return folder


# What is scored -----------------------------------------------------------------------------


@pytest.mark.slow
def test_the_table_is_that_of_python_and_follows_from_the_missions(whole: Path, file: Path) -> None:
    config = compose(["experiment=tiny", "executor=serial", "trials=3"], config_dir=USER_PARTS)
    given = read_given([str(file)], config.build())
    expected = evoros.evaluate(config, [one.design for one in given])
    rows = table(whole)
    assert list(rows["design"]) == ["b", "7"]
    assert list(rows.columns[:5]) == ["source", "design", "fitness_mean", "fitness_sd", "trials"]
    numbers = list(expected.columns[1:])
    np.testing.assert_array_equal(rows[numbers].to_numpy(), expected[numbers].to_numpy())
    missions = pd.read_csv(whole / "missions.csv", dtype={"design": str})
    assert len(missions) == 2 * 2 * 3
    assert missions.groupby(["design", "world", "trial"]).size().eq(1).all()
    for world in ("near", "far"):
        done = missions[missions["world"] == world].groupby("design")["completed"].mean()
        assert list(rows[f"{world}_completed"]) == [done["b"], done["7"]]


def test_an_evaluation_is_loaded_and_has_no_tables_of_a_run(whole: Path) -> None:
    loaded = evoros.load_run(whole)
    rows = list(everything(whole)["missions.csv"].decode().splitlines())
    assert [loaded.missions.columns[0], len(loaded.missions)] == ["source", len(rows) - 1]
    assert loaded.designs["design"].astype(str).tolist() == ["b", "7"]
    for name in ("generations", "champion", "genes"):
        with pytest.raises(InputError, match="its tables: missions and designs"):
            getattr(loaded, name)
    with pytest.raises(InputError, match="but only a run has this table"):
        loaded.trajectory("near")


def test_a_run_has_no_table_of_an_evaluation(run: Path) -> None:
    with pytest.raises(InputError, match="a run, but only an evaluation has this table"):
        _ = evoros.load_run(run).designs


@pytest.mark.slow
def test_draws_are_none_of_the_runs_and_the_same_for_all_designs(run: Path, tmp_path: Path) -> None:
    assert scored(tmp_path / "scores", run, "trials=2") == DONE
    assert scored(tmp_path / "seed", run, "trials=2", "seed=1") == DONE
    seen, fresh, other = (
        set(pd.read_csv(folder / "missions.csv")["draws"])
        for folder in (run, tmp_path / "scores", tmp_path / "seed")
    )
    assert len(seen | fresh | other) == len(seen) + len(fresh) + len(other)


def test_designs_meet_the_same_draws(whole: Path) -> None:
    missions = pd.read_csv(whole / "missions.csv")
    assert missions.groupby(["world", "trial"])["draws"].nunique().eq(1).all()
    assert missions["draws"].nunique() == 6


@pytest.mark.slow
def test_trials_alternate_the_direction_as_generations_do(tmp_path: Path) -> None:
    """The even trials are those of an evaluation that only goes forward, the others backward."""
    (tmp_path / "one.csv").write_text(f"{HEADER}\na,0,0.2,0,0\n")
    rows = []
    for direction in ("parity", "forward", "backward"):
        folder, key = tmp_path / direction, "world.near.course.direction"
        only = ("~world.far", "trials=2", f"{key}={direction}")
        assert scored(folder, tmp_path / "one.csv", *only) == DONE
        rows.append(pd.read_csv(folder / "missions.csv").drop(columns=["reason", "digest"]))
    parity, forward, backward = rows
    assert not forward.equals(backward)
    assert parity.equals(forward.where(forward["trial"] % 2 == 0, backward))


def test_what_is_left_out_is_the_robots_mount_and_the_only_type(tmp_path: Path) -> None:
    robot = compose(["experiment=tiny"], config_dir=USER_PARTS).build().robot
    (tmp_path / "short.csv").write_text(f"{HEADER},z_m\n0,0,0.2,0.1,30,\n")
    mount = f"sonar,{robot.mount_link},0.2,0.1,{robot.mount_z_m},30,{robot.mount_pitch_deg}"
    names = "design,sensor,type,link,x_m,y_m,z_m,yaw_deg,pitch_deg"
    (tmp_path / "long.csv").write_text(f"{names}\n0,0,{mount}\n")
    experiment = compose(["experiment=tiny"], config_dir=USER_PARTS).build()
    short, long = (read_given([str(tmp_path / f"{n}.csv")], experiment) for n in ("short", "long"))
    assert short[0].design == long[0].design


@pytest.mark.slow
def test_sensors_may_come_in_any_order_and_number(tmp_path: Path) -> None:
    rows = ["a,1,0.1,0,10", "c,,,,", "b,0,0.1,0,5", "a,0,0.2,0,0"]
    (tmp_path / "mixed.csv").write_text("\n".join([HEADER, *rows]))
    assert scored(tmp_path / "scores", tmp_path / "mixed.csv") == DONE
    assert list(table(tmp_path / "scores")["design"]) == ["a", "c", "b"]
    kept = pd.read_csv(tmp_path / "scores" / "designs_in.csv")
    assert list(kept["yaw_deg"][kept["design"] == "a"]) == [0, 10]
    assert kept["sensor"][kept["design"] == "c"].isna().all()
    missions = pd.read_csv(tmp_path / "scores" / "missions.csv")
    assert set(missions["sensors"][missions["design"] == "c"]) == {0}
    assert resume(tmp_path / "scores") == DONE


def test_a_run_stands_for_its_champion_with_its_genes(run: Path, tmp_path: Path) -> None:
    """And its sensors are where it had them: the table of the champion is given back."""
    assert scored(tmp_path / "scores", run, "trials=2") == DONE
    kept = pd.read_csv(tmp_path / "scores" / "designs_in.csv")
    champion = pd.read_csv(run / "champion" / "design.csv")
    assert kept.drop(columns="source").equals(champion)
    genes = pd.read_csv(tmp_path / "scores" / "genes_in.csv")
    assert list(genes["key"]) == ["controller.avoidance.range_m"]
    value = pd.read_csv(run / "champion" / "genes.csv")["value"].item()
    assert genes["value"].item() == value
    shutil.copy(run / "champion" / "design.csv", tmp_path / "alone.csv")
    more = [f"controller.avoidance.range_m={value!r}", "trials=2"]
    assert scored(tmp_path / "other", tmp_path / "alone.csv", *more) == DONE
    numbers = ["fitness_mean", "fitness_sd", "near_progress", "far_progress"]
    both = [table(tmp_path / name)[numbers] for name in ("scores", "other")]
    assert both[0].equals(both[1])


def test_a_file_has_the_genes_that_lie_beside_it(run: Path, tmp_path: Path) -> None:
    """The champion is the same design by its folder, its file, and the file of an evaluation."""
    overrides = ["experiment=tiny", "controller.avoidance.range_m=5"]
    experiment = compose(overrides, config_dir=USER_PARTS).build()
    folder = tmp_path / "scores"
    shutil.copytree(run / "champion", tmp_path / "champion")
    file = tmp_path / "champion" / "design.csv"
    (champion,) = read_given([str(run)], experiment)
    assert champion.design.values
    (same,) = read_given([str(file)], experiment)
    assert same.design == champion.design
    folder.mkdir()
    for name, content in write_designs([champion]).items():
        (folder / name).write_text(content)
    assert read_given([str(folder / "designs_in.csv")], experiment) == [champion]
    with pytest.raises(InputError, match="is repeated in"):
        read_given([str(run), str(folder / "designs_in.csv")], experiment)
    file.with_name("genes.csv").unlink()
    (bare,) = read_given([str(file)], experiment)
    assert bare.design == replace(champion.design, values={})


@pytest.mark.slow
def test_another_robot_than_that_of_the_run_is_told(
    run: Path, tmp_path: Path, capsys: Capture
) -> None:
    assert scored(tmp_path / "same", run) == DONE
    assert "was evolved on" not in capsys.readouterr().err
    assert scored(tmp_path / "other", run, "robot=two_wheeler") == DONE
    (line,) = (line for line in capsys.readouterr().err.splitlines() if "was evolved on" in line)
    assert line.startswith(f"{run}: ")
    assert "erle_rover, but is scored on two_wheeler" in line
    assert f"with the run's configuration, type like={run}" in line


def test_designs_of_several_sources_stay_apart(file: Path, run: Path, tmp_path: Path) -> None:
    (tmp_path / "also.csv").write_text(TWO)
    sources = [str(file), str(tmp_path / "also.csv"), str(run)]
    assert scored(tmp_path / "scores", f"[{','.join(sources)}]") == DONE
    rows = table(tmp_path / "scores")
    assert list(rows["source"]) == [sources[0]] * 2 + [sources[1]] * 2 + [sources[2]]
    assert not rows.duplicated(["source", "design"]).any()
    assert list(rows["fitness_mean"][:2]) == list(rows["fitness_mean"][2:4])


@pytest.fixture
def sweep(run: Path, tmp_path: Path) -> Path:
    """Two finished runs, and what a sweep leaves where it was stopped, killed or damaged."""
    folder = tmp_path / "sweep"
    for name in ("a-10", "a-9", "deep/a-1", "stopped", "killed", "damaged"):
        shutil.copytree(run, folder / name)
    status = json.loads((run / "status.json").read_text()) | {"state": "stopped"}
    (folder / "stopped" / "status.json").write_text(json.dumps(status))
    (folder / "killed" / "manifest.json").unlink()
    (folder / "killed" / "status.json").unlink()
    (folder / "damaged" / "champion" / "design.csv").write_text(f"{HEADER}\n0,0,a,0,0\n")
    for name in ("stopped", "damaged"):
        reseal(folder / name)
    return folder


@pytest.mark.slow
def test_a_folder_of_runs_stands_for_the_champions_of_the_finished_ones(
    sweep: Path, whole: Path, tmp_path: Path, capsys: Capture
) -> None:
    shutil.copytree(whole, sweep / "scores")  # an evaluation is no run
    assert scored(tmp_path / "scores", f"{sweep}/", "trials=2") == DONE
    rows = table(tmp_path / "scores")
    assert list(rows["source"]) == [f"{sweep}/{name}" for name in ("a-9", "a-10", "deep/a-1")]
    said = [line for line in capsys.readouterr().err.splitlines() if "left out" in line]
    assert len(said) == 3
    for name, why in (("damaged", "x_m"), ("killed", "contains no run"), ("stopped", "is stopped")):
        assert [why in line for line in said if f"sweep/{name}" in line] == [True]
    assert "left out" in (tmp_path / "scores" / "evoros.log").read_text()
    alone = tmp_path / "alone"
    assert scored(alone, sweep / "a-9", "trials=2") == DONE
    other = [frame.drop(columns="source").iloc[0] for frame in (rows, table(alone))]
    assert other[0].equals(other[1])


def test_a_folder_without_a_finished_run_is_one_clear_line(
    sweep: Path, tmp_path: Path, capsys: Capture
) -> None:
    for name in ("a-9", "a-10", "deep"):
        shutil.rmtree(sweep / name)
    assert scored(tmp_path / "scores", sweep) == INPUT
    *warnings, error = capsys.readouterr().err.splitlines()
    assert len(warnings) == 3
    assert "contains 3 runs, but no champion that can be scored" in error
    assert not (tmp_path / "scores").exists()


def test_a_run_of_a_sweep_is_not_scored_twice(sweep: Path, tmp_path: Path, capsys: Capture) -> None:
    assert scored(tmp_path / "scores", f"[{sweep / 'a-9'},{sweep}]") == INPUT
    assert "is named twice; remove one of the two" in capsys.readouterr().err


@pytest.mark.slow
def test_a_sweep_is_one_evaluation_for_each_combination(file: Path, tmp_path: Path) -> None:
    more = [f"designs={file}", f"hydra.sweep.dir={tmp_path / 'sweep'}", "failure=spatial,random"]
    assert evaluate(["-m", *TINY, "executor=serial", *more]) == DONE
    tables = [table(path) for path in (tmp_path / "sweep").iterdir()]
    assert [len(frame) for frame in tables] == [2, 2]


# Interruption -------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_signal_loses_nothing_and_the_folder_stands_alone(whole: Path, tmp_path: Path) -> None:
    (tmp_path / "two.csv").write_text(TWO)
    more = ["designs=two.csv", "trials=3", "simulator.pause_s=0.5", "executor.workers=2"]
    process = start(["evaluate", *TINY, *more, "hydra.run.dir=scores"], tmp_path)
    wait_for_missions(tmp_path / "scores", 3)
    process.send_signal(signal.SIGTERM)
    _, err = process.communicate()
    assert process.returncode == STOPPED
    assert "Traceback" not in err
    assert f"evoros resume scores {OPTION}" in err
    flown = (tmp_path / "scores" / "missions.csv").read_bytes().rpartition(b"\n")[0]
    (tmp_path / "two.csv").unlink()
    assert resume(tmp_path / "scores", "executor=serial") == DONE
    after = (tmp_path / "scores" / "missions.csv").read_bytes().splitlines()
    assert set(flown.splitlines()) <= set(after)
    rows, expected = table(tmp_path / "scores"), table(whole)
    assert rows.drop(columns="source").equals(expected.drop(columns="source"))
    assert json.loads((tmp_path / "scores" / "status.json").read_text())["state"] == "finished"


def test_resuming_a_finished_evaluation_verifies_it(
    whole: Path, tmp_path: Path, capsys: Capture
) -> None:
    folder = tmp_path / "again"
    shutil.copytree(whole, folder)
    assert resume(folder) == DONE
    assert ", 0 of them in this session" in capsys.readouterr().out
    assert content(folder) == content(whole)
    text = (folder / "designs.csv").read_text()
    (folder / "designs.csv").write_text(text.replace(",3,", ",4,"))
    reseal(folder)
    assert resume(folder) == INPUT
    assert "designs.csv" in capsys.readouterr().err


def test_a_lost_mission_stops_the_evaluation_which_can_be_resumed(
    file: Path, tmp_path: Path, capsys: Capture
) -> None:
    faulty = ["simulator.fault=raise", f"simulator.mark={tmp_path / 'mark'}"]
    assert scored(tmp_path / "scores", file, *faulty) == STOPPED
    assert "correct the code and start a new run" in capsys.readouterr().err
    assert resume(tmp_path / "scores") == DONE  # the part is as it was
    assert len(table(tmp_path / "scores")) == 2


@pytest.mark.slow
def test_memory_does_not_grow_with_the_missions(tmp_path: Path, monkeypatch: Patch) -> None:
    """Outcomes are kept for the designs in work alone."""
    outcomes: tuple[Outcome, ...] = (Outcome.failure("time_limit", "", 20.0, 1),)

    def instant(
        dispatcher: object, scenario: object, missions: Iterable[Mission]
    ) -> Iterator[list[tuple[Mission, tuple[Outcome, ...]]]]:
        yield from ([(mission, outcomes)] for mission in missions)

    def create(path: Path, files: Mapping[str, str]) -> None:
        create_folder(path, files)
        tracemalloc.start()  # of what is allocated from now on

    monkeypatch.setattr(dispatcher.Dispatcher, "run", instant)
    monkeypatch.setattr(run_folder, "create_folder", create)
    rows = "\n".join(f"{i},0,0.1,0,{i}" for i in range(20))
    (tmp_path / "twenty.csv").write_text(f"{HEADER}\n{rows}\n")
    peaks: list[int] = []
    for trials in (10, 100):
        folder = tmp_path / f"{trials}"
        assert scored(folder, tmp_path / "twenty.csv", f"trials={trials}") == DONE
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        assert len((folder / "missions.csv").read_text().splitlines()) == 1 + 20 * 2 * trials
    assert peaks[1] < peaks[0] + 500_000  # all missions would be several times as much


# What is refused ----------------------------------------------------------------------------


def test_a_run_is_no_evaluation_and_the_other_way_round(
    whole: Path, run: Path, capsys: Capture
) -> None:
    before = everything(whole), everything(run)
    assert resume(whole, "optimizer.generations=30") == INPUT
    assert "resume accepts only" in capsys.readouterr().err
    assert scored(whole, run) == INPUT
    assert f"type: evoros resume {whole}" in capsys.readouterr().err
    assert before == (everything(whole), everything(run))


BAD = [
    ("", "line 1: must have the column design, but has none"),
    (HEADER, "must have at least one design; add a row"),
    ("design,sensor,x_m,yaw_deg\n0,0,0,0", "line 1: must have the column y_m"),
    (f"{HEADER},z\n0,0,0,0,0,0", "line 1: has the unknown column 'z'"),
    (f"{HEADER},x_m\n0,0,0,0,0,0", "line 1: repeats the column 'x_m'"),
    (f"{HEADER}\n0,0,a,0,0", "line 2: x_m must be a number, not 'a'"),
    (f"{HEADER}\n0,0,0.1,0,nan", "line 2: yaw_deg must be a number, not 'nan'"),
    (f"{HEADER}\n0,0,0.1,0,1{'0' * 400}", "line 2: yaw_deg must be a number, not '1000"),
    (f"{HEADER}\n0,0,0.1,,0", "line 2: y_m must be a number, not ''"),
    (f"{HEADER}\n0,0,24,0,0", "line 2: sensor: x extends from"),
    (f"{HEADER}\n0,0,0.1,0,400", "line 2: yaw_deg: must be a number, or [low, high]"),
    (f"{HEADER}\n0,x,0.1,0,0", "line 2: sensor must be a non-negative integer, not 'x'"),
    (f"{HEADER}\n,0,0.1,0,0", "line 2: design is empty"),
    (f"{HEADER}\n0,0,0.1,0", "line 2: must have 5 cells, like the first line, not 4"),
    (f"{HEADER}\n0,0,0.1,0,0\n0,0,0.2,0,0", "line 3: design '0' has sensor 0 twice"),
    (f"{HEADER}\n0,0,0.1,0,0\n0,,,,", "line 3: design '0' must have either rows with sensors or"),
    (f"{HEADER},type\n0,0,0.1,0,0,lidar", "line 2: type must be one of sonar, not 'lidar'"),
    (f"{HEADER},link\n0,0,0.1,0,0,nix", "line 2: sensor.link: must be a link of"),
    (f"{HEADER}\n0,0,0.1,0,\ufffd\xff", "line 2: yaw_deg must be a number"),
]


@pytest.fixture(scope="module")
def experiment() -> Experiment:
    return compose(["experiment=tiny"], config_dir=USER_PARTS).build()


@pytest.mark.parametrize(("text", "said"), BAD, ids=[said[:40] for _, said in BAD])
def test_a_bad_file_is_one_clear_line(
    text: str, said: str, experiment: Experiment, tmp_path: Path
) -> None:
    (tmp_path / "bad.csv").write_text(text)
    with pytest.raises(InputError, match=re.escape(f"{tmp_path / 'bad.csv'}: {said}")) as error:
        read_given([str(tmp_path / "bad.csv")], experiment)
    assert "\n" not in str(error.value)


def test_a_bad_file_leaves_no_folder(tmp_path: Path, capsys: Capture) -> None:
    text, said = BAD[0]
    (tmp_path / "bad.csv").write_text(text)
    refused(tmp_path, tmp_path / "bad.csv", f"{tmp_path / 'bad.csv'}: {said}", capsys)


def refused(folder: Path, designs: object, said: str, capsys: Capture, *more: str) -> None:
    assert scored(folder / "scores", designs, *more) == INPUT
    out, err = capsys.readouterr()
    assert out == ""
    assert re.fullmatch(r"evoros evaluate: [^\n]+\n", err)
    assert said in err
    assert not (folder / "scores").exists()


@pytest.mark.slow
def test_bad_sources_are_one_clear_line_each(
    whole: Path, run: Path, file: Path, tmp_path: Path, capsys: Capture
) -> None:
    refused(tmp_path, "null", "designs: must be a CSV file, the folder of a finished run", capsys)
    refused(tmp_path, "3", "designs: must be a CSV file, the folder of a finished run", capsys)
    refused(tmp_path, "[]", "designs: must be a CSV file, the folder of a finished run", capsys)
    refused(
        tmp_path, "nix.csv", "nix.csv: not found; give a CSV file of designs or the folder", capsys
    )
    refused(tmp_path, tmp_path, "but contains no run", capsys)
    refused(tmp_path, whole, "but contains an evaluation", capsys)
    refused(tmp_path, f"[{file},{file}]", "is named twice; remove one of the two", capsys)
    refused(tmp_path, file, "designz: no such key", capsys, "designz=1")
    (tmp_path / "latin.csv").write_bytes(f"{HEADER}\n0,0,0,0,\xe9".encode("latin-1"))
    refused(tmp_path, tmp_path / "latin.csv", "must be a CSV file in UTF-8", capsys)
    shutil.copytree(run, tmp_path / "half")
    status = json.loads((run / "status.json").read_text()) | {"state": "stopped"}
    (tmp_path / "half" / "status.json").write_text(json.dumps(status))
    reseal(tmp_path / "half")
    half = tmp_path / "half"
    said = f"with a champion, but its state is stopped; type: evoros resume {half}"
    refused(tmp_path, half, said, capsys)


def test_a_design_that_the_parts_refuse_is_refused_before_anything_is_made(
    run: Path, tmp_path: Path, capsys: Capture
) -> None:
    """The champion's reach has no place in a controller that does not avoid."""
    refused(
        tmp_path,
        run,
        "controller.avoidance.range_m: must be the path of an existing value",
        capsys,
        "controller/avoidance=blind",
    )


def test_what_was_scored_must_not_be_changed(whole: Path, tmp_path: Path, capsys: Capture) -> None:
    folder = tmp_path / "edited"
    shutil.copytree(whole, folder)
    text = (folder / "designs_in.csv").read_text()
    (folder / "designs_in.csv").write_text(text.replace(",30.0,", ",31.0,"))
    assert resume(folder) == INPUT
    assert "designs_in.csv: line 3: has changed since evoros wrote it" in capsys.readouterr().err
    (folder / "digests.csv").unlink()  # the manifest has the hash, too
    assert resume(folder) == INPUT
    assert "designs_in.csv has changed since the run began" in capsys.readouterr().err


# The documents ------------------------------------------------------------------------------


def test_a_table_of_designs_can_be_given_as_it_is_written(tmp_path: Path) -> None:
    """That of a champion, with several designs in one file."""
    experiment = compose(["experiment=tiny"], config_dir=USER_PARTS).build()
    rng = np.random.default_rng(0)
    size = experiment.space.size
    designs: dict[int, Design] = {i: experiment.space.decode(rng.random(size)) for i in range(20)}
    (tmp_path / "many.csv").write_text(design_table(designs))
    given = read_given([str(tmp_path / "many.csv")], experiment)
    assert [one.name for one in given] == [str(i) for i in designs]
    assert [one.design.mounts for one in given] == [one.mounts for one in designs.values()]


def documented(heading: str, first: str) -> list[str]:
    """The first cells of the tables of one section of evaluation.md."""
    text = (ROOT / "docs" / "evaluation.md").read_text()
    (section,) = re.findall(rf"^#+ {re.escape(heading)}\n(.*?)(?=^#|\Z)", text, re.M | re.S)
    rows = [line.split("|")[1] for line in section.splitlines() if line[:1] == "|"]
    columns = [name for row in rows for name in re.findall(r"[a-zA-Z][\w.]*", row)]
    assert columns[0] == first
    return columns[1:]


def test_columns_fields_and_files_are_documented(whole: Path) -> None:
    names = (whole / "designs.csv").read_text().splitlines()[0].split(",")
    columns = [name.replace("near", "WORLD") for name in names if "far" not in name]
    assert documented("designs.csv", "column") == columns
    status = json.loads((whole / "status.json").read_text())
    assert documented("status.json", "field") == list(status)
    assert set(documented("The folder", "file")) == {path.name for path in whole.iterdir()}
    assert documented("Designs", "column") == list(DESIGN_COLUMNS)
