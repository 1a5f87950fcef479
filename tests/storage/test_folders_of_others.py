"""Folders of others are data: no link leads out of them, and they name no class to import."""

import json
import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import yaml
from helpers import TINY, USER_PARTS, copied, everything, reseal, resume, scored, tiny

import evoros
from evoros.analysis.command import evoros_analyze
from evoros.base.errors import InputError
from evoros.cli.command import evaluate
from evoros.cli.diff import diff
from evoros.cli.main import evoros as evolve
from evoros.session import rebuilding as resuming
from evoros.storage.layout import seal_json
from evoros.storage.reading import load_run
from evoros.terminal.console import DONE, INPUT


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("theirs") / "run"
    assert tiny(folder, "optimizer.generations=1", "record=all", "figures=[fitness]") == DONE
    return folder


COMMANDS: dict[str, Callable[[Path, Path], int]] = {
    "resume": lambda folder, out: resume(folder),
    "analyze": lambda folder, out: evoros_analyze(["fitness", str(folder)]),
    "evaluate": lambda folder, out: evaluate(
        [*TINY, "executor=serial", f"designs={folder}", f"hydra.run.dir={out}"]
    ),
    "compare": lambda folder, out: diff([str(folder), str(folder)]),
}


def places(folder: Path) -> list[str]:
    """A file and a folder of each kind, and the drafts of files that are replaced."""
    names = ["missions.csv", "config.yaml", "manifest.json", "digests.csv", "evoros.log"]
    names += ["status.json", "champion/design.csv", "generations/00000.csv", "figures/fitness.csv"]
    names += ["champion", "generations", "figures", "trajectories", "trajectories/robots"]
    assert all((folder / name).exists() for name in names)
    return [*names, ".missions.csv.part", "lost", "champion/.design.csv.part", "damaged"]


@pytest.mark.parametrize(
    "command",
    [pytest.param(name, marks=[pytest.mark.slow] * (name == "evaluate")) for name in COMMANDS],
)
def test_no_link_is_followed(
    command: str, run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in places(run):
        folder, outside = copied(run, tmp_path / "run"), tmp_path / "outside"
        outside.mkdir()
        place = folder / name
        if place.exists():
            place.rename(outside / "target")
        else:
            (outside / "target").mkdir()
        place.symlink_to(outside / "target")
        before = everything(outside)
        capsys.readouterr()
        assert COMMANDS[command](folder, tmp_path / "out") == INPUT, name
        said = capsys.readouterr().err.splitlines()
        assert f"{place}: must be a regular file or folder, not a symbolic link" in said[0]
        assert everything(outside) == before
        assert not (tmp_path / "out").exists()
        shutil.rmtree(folder)
        shutil.rmtree(outside)


def test_a_pipe_is_not_waited_for(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = copied(run, tmp_path / "run")
    (folder / "champion" / "genes.csv").unlink()
    os.mkfifo(folder / "champion" / "genes.csv")
    assert resume(folder) == INPUT
    assert "not a pipe or a device" in capsys.readouterr().err


def test_the_folder_itself_may_be_a_link(run: Path, tmp_path: Path) -> None:
    folder = copied(run, tmp_path / "run")
    (tmp_path / "link").symlink_to(folder)
    assert resume(tmp_path / "link") == DONE
    assert load_run(tmp_path / "link").missions.equals(load_run(run).missions)


# Classes ------------------------------------------------------------------------------------


def rename(folder: Path, key: str, target: object) -> None:
    """Name another class in a configuration, whose digests are right."""
    tree = yaml.safe_load((folder / "config.yaml").read_text())
    *path, last = key.split(".")
    node = tree
    for name in path:
        node = node[name]
    node[last] = target
    (folder / "config.yaml").write_text(yaml.safe_dump(tree))
    reseal(folder)


@pytest.fixture
def mark(tmp_path: Path) -> Iterator[Path]:
    path = tmp_path / "mark"
    yield path
    assert not path.exists()


CALLS = {
    "os.system": ["touch MARK"],
    "subprocess.check_call": [["touch", "MARK"]],
    "builtins.exec": ["open('MARK', 'w')"],
    "pandas.read_pickle": ["MARK"],
    "hydra.utils.instantiate": [{"_target_": "os.system", "_args_": ["touch MARK"]}],
    "evoros.files.disk.os.mkdir": ["MARK"],
    "evoros.files.disk.make_folder": [{"_target_": "pathlib.Path", "_args_": ["MARK"]}],
    "evoros.terminal.log.log_to_file": ["MARK"],
    "evoros.storage.run_folder.RunFolder": ["MARK"],
    "evoros.cli.main.evoros": [["hydra.run.dir=MARK"]],
    "no.such.module": [],
    "": [],
    "..": [],
    "${seed}": [],
}


@pytest.mark.parametrize("target", CALLS)
def test_resuming_calls_nothing_but_parts(
    target: str, run: Path, tmp_path: Path, mark: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = copied(run, tmp_path / "run")
    arguments = yaml.safe_load(yaml.safe_dump(CALLS[target]).replace("MARK", str(mark)))
    rename(folder, "fitness", {"_target_": target, "_args_": arguments})
    before = everything(folder)
    capsys.readouterr()
    assert resume(folder) == INPUT
    (line,) = capsys.readouterr().err.splitlines()
    assert f"{folder / 'config.yaml'}: fitness." in line
    assert "_target_: " in line
    assert everything(folder) == before
    assert not mark.exists()
    with pytest.raises(InputError, match=r"fitness\..*_target_"):
        evoros.replay(folder, (0, 0, "near", 0), config_dir=USER_PARTS)


def test_a_class_deep_in_the_configuration_is_found(
    run: Path, tmp_path: Path, mark: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = copied(run, tmp_path / "run")
    call = {"_target_": "os.system", "_args_": [f"touch {mark}"]}
    rename(folder, "failure.earliest_s", [1.0, {"deep": call}])
    assert resume(folder) == INPUT
    assert "failure.earliest_s[1].deep._target_: must be a class in evoros" in (
        capsys.readouterr().err
    )


def test_a_folder_that_is_not_named_is_not_imported_from(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(resuming, "NAMED_FOLDERS", [])  # as in a fresh process
    folder = copied(run, tmp_path / "run")
    before = everything(folder)
    (tmp_path / "other").mkdir()
    for more in ([], ["--config-dir", str(tmp_path / "other")]):
        assert evolve(["resume", str(folder), *more]) == INPUT
        (line,) = capsys.readouterr().err.splitlines()
        assert "add --config-dir with the folder that contains the module planar" in line
    assert everything(folder) == before


def test_python_objects_in_yaml_are_no_objects(run: Path, tmp_path: Path, mark: Path) -> None:
    folder = copied(run, tmp_path / "run")
    with (folder / "config.yaml").open("a") as config:
        config.write(f"note: !!python/object/apply:os.system ['touch {mark}']\n")
    reseal(folder)
    assert resume(folder) == INPUT
    assert evoros_analyze(["fitness", str(folder)]) == INPUT


@pytest.mark.slow
def test_analysis_imports_no_class(
    run: Path, tmp_path: Path, mark: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The class exists, and importing its module would leave a mark."""
    (tmp_path / "evil.py").write_text(f"open({str(mark)!r}, 'w')\nclass Evil: ...\n")
    monkeypatch.syspath_prepend(tmp_path)
    folder = copied(run, tmp_path / "run")
    rename(folder, "fitness._target_", "evil.Evil")
    rename(folder, "simulator._target_", "evil.Evil")
    scored(tmp_path / "scores", folder)
    for name in ("fitness", "mission", "overlay", "compare", "report"):
        given = [name, str(tmp_path / "run"), str(tmp_path / "scores")]
        assert evoros_analyze([*given, "--output", str(tmp_path / "out")]) == DONE


@pytest.mark.parametrize(
    "content",
    [
        '<sdf version="1.9" xmlns:xacro="http://www.ros.org/wiki/xacro"><world name="w"/></sdf>',
        '<sdf version="1.9"><world name="w"><include><uri>FILE</uri></include></world></sdf>',
        '<sdf version="1.9"><world name="w"><model name="m"><static>1</static><link name="l">'
        '<collision name="c"><geometry><mesh><uri>FILE</uri></mesh></geometry></collision>'
        "</link></model></world></sdf>",
    ],
)
def test_a_world_in_a_folder_runs_no_code_and_reads_nothing_outside(
    content: str, run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = copied(run, tmp_path / "run")
    (folder / "champion" / "world_near.sdf").write_text(content.replace("FILE", "/etc/x.obj"))
    reseal(folder)
    capsys.readouterr()
    given = ["mission", str(folder), "--world", "near", "--output", str(tmp_path / "out")]
    assert evoros_analyze(given) == INPUT
    assert "champion/world_near.sdf: must be a world written by evoros" in capsys.readouterr().err


# Sealed files -------------------------------------------------------------------------------

FORGED = [
    ("manifest.json", "agents", 5, "a list of strings"),
    ("manifest.json", "agents", [None], "a list of strings"),
    ("manifest.json", "choices", "none", "an object"),
    ("manifest.json", "working_directory", {"a": 1}, "a string"),
    ("manifest.json", "packages", {"numpy": [2]}, "an object with strings"),
    ("manifest.json", "columns", "no", "a list of strings"),
    ("status.json", "state", ["finished"], "a string"),
    ("status.json", "generations", "many", "a number or null"),
    ("status.json", "best_fitness", {}, "a number or null"),
]


@pytest.mark.parametrize(("name", "key", "value", "kind"), FORGED)
def test_a_forged_type_is_one_line(
    name: str, key: str, value: object, kind: str, run: Path, tmp_path: Path
) -> None:
    folder = copied(run, tmp_path / "run")
    fields = json.loads((folder / name).read_text()) | {key: value}
    fields.pop("digest")
    (folder / name).write_text(seal_json(name, fields))
    reseal(folder)
    with pytest.raises(InputError, match=rf"{name} \({key} must be {kind}, not ") as error:
        load_run(folder)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("name", ["manifest.json", "status.json"])
@pytest.mark.parametrize("brackets", ["[", '{"a":'])
def test_a_file_that_is_nested_deep_is_one_line(
    name: str, brackets: str, run: Path, tmp_path: Path
) -> None:
    folder = copied(run, tmp_path / "run")
    (folder / name).write_text(brackets * 100_000)
    with pytest.raises(
        InputError, match=rf"{name} \(.*\): has changed since evoros wrote it"
    ) as error:
        load_run(folder)
    assert "\n" not in str(error.value)
