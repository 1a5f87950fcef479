"""An archive holds a study and no traces of the machine, and is read like the folders in it."""

import json
import os
import resource
import shlex
import socket
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple
from zipfile import ZipFile

import pytest
from fixture_types import Capture, Folders, Patch
from helpers import TINY, USER_PARTS, everything, finished_run, start

import evoros
from evoros.analysis.command import evoros_analyze
from evoros.base.errors import InputError
from evoros.cli.command import evaluate
from evoros.cli.diff import diff
from evoros.cli.main import evoros as evoros_run
from evoros.cli.status import status
from evoros.files.origin import Origin
from evoros.plugins.archives import software
from evoros.plugins.archives.archive import archive
from evoros.plugins.archives.reproduce import reproduce
from evoros.plugins.archives.tests.crate_cases import rewrite, run_project, write_project
from evoros.storage.archives import RECORD, write_record
from evoros.terminal.console import DONE, INPUT

TOKEN = "planted-7f3a-in-the-environment"
HOST = "planted-host-7f3a"


class Case(NamedTuple):
    project: Path
    run: Path
    file: Path  # the archive


@pytest.fixture(scope="module")
def case(tmp_path_factory: Folders) -> Iterator[Case]:
    """A run in a folder with a space in the home folder, with a reference to a secret."""
    home = tmp_path_factory.mktemp("home") / "somebody"
    cache = os.environ.get("XDG_CACHE_HOME", str(Path.home() / ".cache"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", cache)  # has the compiled rules
        patch.setenv("HOME", str(home))
        patch.setenv("EVOROS_TOKEN", TOKEN)
        patch.setattr(socket, "gethostname", lambda: HOST)
        project = write_project(home / "my project")
        patch.chdir(project)
        secret = "+robot.environment.TOKEN=${oc.env:EVOROS_TOKEN}"
        host = f"+robot.environment.HOST=tcp://{HOST}:8786"
        run = run_project(project, project / "outputs" / "one", secret, host)
        file = project / "study.zip"
        assert archived(file, run, "--config-dir", str(project / "mine")) == DONE
        yield Case(project, run, file)


def archived(file: Path, *arguments: object) -> int:
    return archive([*map(str, arguments), "--output", str(file)])


def refused_last(call: Callable[[], int], capsys: Capture) -> str:
    """The last line, after notes about how files were read."""
    capsys.readouterr()
    assert call() == INPUT
    *notes, error = capsys.readouterr().err.splitlines()
    assert all("about how files were read" in note for note in notes), notes
    return error


def members(file: Path) -> dict[str, bytes]:
    with ZipFile(file) as opened:
        return {name: opened.read(name) for name in opened.namelist()}


def test_it_has_all_that_the_run_follows_from(case: Case) -> None:
    files = members(case.file)
    for name in ("mine/silent_failures.py", "mine/failure/first.yaml", "robots/meshes/body.stl"):
        assert files[f"inputs/{name}"] == (case.project / name).read_bytes()
    for name in ("missions.csv", "champion/design.csv", "generations/00000.csv"):
        assert f"runs/one/{name}" in files
    assert f"numpy=={sys.modules['numpy'].__version__}\n" in (
        files["software/requirements.txt"].decode()
    )
    assert b"evoros reproduce study.zip" in files["README.md"]


def test_nothing_in_it_tells_of_the_machine_or_the_user(case: Case) -> None:
    private = [TOKEN, str(Path.home()), Path.home().name, str(case.run), HOST]
    for name, content in members(case.file).items():
        for text in private:
            assert text.encode() not in content, (name, text)
            assert text not in name
    assert b"${oc.env:EVOROS_TOKEN}" in members(case.file)["runs/one/config.yaml"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (f"token = '{TOKEN}'", "the value of the environment variable EVOROS_TOKEN"),
        ("path = 'HOME/data.csv'", "the path of your home folder"),
    ],
)
def test_a_secret_in_a_part_is_refused(
    text: str, said: str, case: Case, tmp_path: Path, capsys: Capture
) -> None:
    part = case.project / "mine" / "note.txt"
    part.write_text(f"\n{text.replace('HOME', str(Path.home()))}\n")
    try:
        given = [case.run, "--config-dir", case.project / "mine"]
        error = refused_last(lambda: archived(tmp_path / "new.zip", *given), capsys)
    finally:
        part.unlink()
    assert f"inputs/mine/note.txt: line 2 contains {said}, which" in error
    assert TOKEN not in error
    assert not [*tmp_path.iterdir()]


def test_the_same_folder_gives_the_same_bytes(case: Case, tmp_path: Path) -> None:
    again = tmp_path / "study.zip"
    assert archived(again, case.run, "--config-dir", case.project / "mine") == DONE
    assert again.read_bytes() == case.file.read_bytes()


def test_one_run_is_read_as_its_folder(case: Case, tmp_path: Path, capsys: Capture) -> None:
    before = case.file.read_bytes(), everything(case.project)
    there, here = evoros.load_run(case.file), evoros.load_run(case.run)
    columns = [name for name in here.missions if name != "digest"]
    assert there.missions[columns].equals(here.missions[columns])
    assert there.generations.equals(here.generations)
    assert evoros_analyze(["fitness", str(case.file), "--output", str(tmp_path / "out")]) == DONE
    assert (tmp_path / "out" / "fitness.pdf").is_file()
    assert status([str(case.file), "--once"]) == DONE
    assert "finished" in capsys.readouterr().out
    assert diff([str(case.file), str(case.file)]) == DONE
    assert (case.file.read_bytes(), everything(case.project)) == before


def test_figures_are_written_beside_an_archive(case: Case, tmp_path: Path) -> None:
    file = tmp_path / "study.zip"
    file.write_bytes(case.file.read_bytes())
    assert evoros_analyze(["fitness", str(file)]) == DONE
    assert (tmp_path / "study_analysis" / "figures" / "fitness.pdf").is_file()


@pytest.mark.slow
def test_one_of_several_runs_is_named(tmp_path: Path, capsys: Capture) -> None:
    study, file = tmp_path / "study", tmp_path / "study.zip"
    for name in ("a", "b"):
        finished_run(study / name)
    parts = USER_PARTS
    assert archived(file, study, "--config-dir", parts) == DONE
    assert diff([str(study), str(file)]) == DONE
    with pytest.raises(InputError, match=rf"single run; give {file}/study/a, {file}/study/b$"):
        evoros.load_run(file)
    run = evoros.load_run(file / "study" / "b")
    assert run.missions.equals(evoros.load_run(study / "b").missions)
    with pytest.raises(InputError, match=rf"study/c: not found in .*; give {file}/study/a, "):
        evoros.load_run(file / "study" / "c")
    pair = tmp_path / "pair.zip"
    assert archived(pair, study / "a", study / "b", "--config-dir", parts) == DONE
    with pytest.raises(InputError, match=rf"not a single run; give {pair}/a, {pair}/b$"):
        evoros.load_run(pair)


@pytest.mark.slow
def test_it_is_reproduced_without_the_project(case: Case, tmp_path: Path) -> None:
    """In a new process, by the code in the archive."""
    file, gone = tmp_path / "study.zip", case.project.with_name("gone")
    file.write_bytes(case.file.read_bytes())
    case.project.rename(gone)
    try:
        process = start(["reproduce", "study.zip", "--output", "a new"], tmp_path, MAIN)
        out, err = process.communicate(timeout=200)
        assert (process.returncode, "\nequal: 6 missions, " in out) == (DONE, True), err
    finally:
        gone.rename(case.project)
    assert {path.name for path in (tmp_path / "a new").iterdir()} == {"inputs", "runs"}
    assert {path.name for path in tmp_path.iterdir()} == {"study.zip", "a new"}


MAIN = "evoros.__main__"


# Sweeps and evaluations ------------------------------------------------------------------------


@pytest.mark.slow
def test_a_run_of_a_sweep_names_it_without_its_path(tmp_path: Path) -> None:
    sweep = tmp_path / "sweep"
    given = [*TINY, "executor=serial", "optimizer.generations=1", f"hydra.sweep.dir={sweep}"]
    assert evoros_run(["-m", *given]) == DONE
    run = next(path for path in sweep.iterdir() if path.is_dir())
    for folder, named in ((sweep, "runs/sweep"), (run, "sweep")):
        file = tmp_path / f"{folder.name}.zip"
        assert archived(file, folder, "--config-dir", USER_PARTS) == DONE
        files = members(file)
        assert not [name for name, content in files.items() if str(tmp_path).encode() in content]
        (manifest,) = (content for name, content in files.items() if name.endswith("manifest.json"))
        assert json.loads(manifest)["sweep"] == named
        assert reproduce([str(file), "--output", str(tmp_path / f"{folder.name}-again")]) == DONE


@pytest.mark.slow
@pytest.mark.parametrize("study_too", [True, False])
def test_an_evaluation_names_no_folder_of_the_machine(study_too: bool, tmp_path: Path) -> None:
    """The evaluation itself records the full paths of its runs, as typed."""
    study, scores, file = (tmp_path / name for name in ("study", "scores", "all.zip"))
    finished_run(study / "a", "optimizer.generations=1")
    given = [f"designs={study}", "trials=1", "executor=serial", f"hydra.run.dir={scores}"]
    assert evaluate([*TINY, *given]) == DONE
    folders = [study, scores] if study_too else [scores]
    assert archived(file, *folders, "--config-dir", USER_PARTS) == DONE
    name = "runs/study/a" if study_too else "a"
    assert not [n for n, content in members(file).items() if str(tmp_path).encode() in content]
    for table in ("designs_in.csv", "designs.csv", "missions.csv"):
        first = members(file)[f"runs/scores/{table}"].decode().splitlines()[1]
        assert first.startswith(f"{name},"), table
    assert status([str(file), "--once"]) == DONE
    assert reproduce([str(file), "--output", str(tmp_path / "again")]) == DONE


# What cannot be archived or read -------------------------------------------------------------


def unfinished(run: Path) -> Path:
    status_file = run / "status.json"
    status_file.unlink()
    return run


CANNOT: dict[str, tuple[Callable[[Case, Path], list[object]], str]] = {
    "no folder": (lambda case, tmp: [tmp / "none"], "folder not found"),
    "no run": (lambda case, tmp: [case.project / "mine"], "must be the folder of a run"),
    "own parts": (lambda case, tmp: [case.run], "add --config-dir"),
    "unfinished": (lambda case, tmp: [unfinished(finished_run(tmp / "run"))], "must be finished"),
    "licence": (lambda case, tmp: [case.run, "--license", "my own"], "must be an SPDX identifier"),
    "twice": (
        lambda case, tmp: [case.run, case.run, "--config-dir", case.project / "mine"],
        "another folder has the same archive path",
    ),
}


def test_missing_parts_of_the_user_are_named_as_one_types_them(
    case: Case, tmp_path: Path, capsys: Capture
) -> None:
    told = refused_last(lambda: archived(tmp_path / "new.zip", case.run), capsys)
    typed = shlex.split(told.rpartition("; add ")[2])
    assert " " in str(case.project)
    assert typed == ["--config-dir", str(case.project / "mine")]


@pytest.mark.parametrize("what", CANNOT)
def test_what_cannot_be_archived_is_one_line(
    what: str, case: Case, tmp_path: Path, capsys: Capture
) -> None:
    arguments, said = CANNOT[what]
    given = arguments(case, tmp_path)
    assert said in refused_last(lambda: archived(tmp_path / "new.zip", *given), capsys)
    assert not [*tmp_path.glob("*.zip")]
    assert not [*tmp_path.glob(".*.part")]


def test_an_existing_file_stays(case: Case, capsys: Capture) -> None:
    before = case.file.read_bytes()
    given = [case.run, "--config-dir", case.project / "mine"]
    assert "already exists" in refused_last(lambda: archived(case.file, *given), capsys)
    assert case.file.read_bytes() == before


def test_a_full_disk_leaves_no_file(case: Case, tmp_path: Path, capsys: Capture) -> None:
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    size = case.file.stat().st_size
    given = [case.run, "--config-dir", case.project / "mine"]
    for share in (0.2, 0.6, 0.99):
        resource.setrlimit(resource.RLIMIT_FSIZE, (int(size * share), limits[1]))
        try:
            error = refused_last(lambda: archived(tmp_path / "new.zip", *given), capsys)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        assert "new.zip: cannot be written" in error
        assert not [*tmp_path.iterdir()]


def change(name: str, content: bytes | None) -> Callable[[dict[str, bytes]], None]:
    def apply(files: dict[str, bytes]) -> None:
        if content is None:
            del files[name]
        else:
            files[name] = content

    return apply


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("runs/one/missions.csv", None, "missions.csv: not found"),
        ("runs/one/more.csv", b"", "not listed in"),
        ("runs/one/missions.csv", b"changed", "missions.csv: checksum mismatch"),
        ("checksums.sha256", b"nonsense\n", "each line must have a SHA-256 and a name"),
        ("checksums.sha256", None, "checksums.sha256 not found"),
        (RECORD, None, f"{RECORD} not found"),
        (RECORD, b"[]", "format_version must be 1, not None"),
        (
            RECORD,
            write_record("9.0.0").replace(b": 1", b": 2"),
            r"format_version must be 1, not 2; read the archive with .*\('9.0.0'\)",
        ),
    ],
)
def test_other_content_is_one_line(
    name: str, content: bytes | None, said: str, case: Case, tmp_path: Path
) -> None:
    file = rewrite(case.file, tmp_path / "study.zip", change(name, content))
    with pytest.raises(InputError, match=said) as error:
        evoros.load_run(file)
    assert str(error.value).startswith(f"{file}: ")
    assert "\n" not in str(error.value)


def test_every_changed_bit_is_noticed(case: Case, tmp_path: Path) -> None:
    """This includes bits of dates, lengths and the digest itself."""
    content = case.file.read_bytes()
    places = {*range(0, len(content), len(content) // 100), *range(len(content) - 90, len(content))}
    for place in places:
        file = tmp_path / f"{place}.zip"
        changed = bytearray(content)
        changed[place] ^= 1 << place % 8
        file.write_bytes(changed)
        with pytest.raises(
            InputError, match=f"{place}.zip: (must|cannot be read|.* has changed)"
        ) as error:
            evoros.load_run(file)
        assert "\n" not in str(error.value)
        file.unlink()


def test_other_inputs_are_named(case: Case, tmp_path: Path, capsys: Capture) -> None:
    """A heavier robot, with the right checksums: the run is refused before it begins."""
    from hashlib import sha256

    from evoros.storage.archives import write_sums

    def heavier(files: dict[str, bytes]) -> None:
        name = "inputs/robots/cart.urdf"
        files[name] = files[name].replace(b'mass value="2"', b'mass value="3"')
        sums = files.pop("checksums.sha256").decode().splitlines()
        names = [line.partition("  ")[2] for line in sums]
        files["checksums.sha256"] = write_sums({n: sha256(files[n]).hexdigest() for n in names})

    file = rewrite(case.file, tmp_path / "study.zip", heavier)
    capsys.readouterr()
    assert reproduce([str(file), "--output", str(tmp_path / "new")]) != DONE
    assert "robot has changed since the run began" in capsys.readouterr().err
    assert not (tmp_path / "new" / "runs").exists()
    assert os.getcwd() == str(case.project)


@pytest.mark.parametrize(
    ("commits", "dirty", "patched"),
    [(["a"], [True], True), (["a"], [False], False), (["b"], [True], False)],
)
def test_the_patch_is_that_of_the_commit_of_the_runs(
    commits: list[str], dirty: list[bool], patched: bool, monkeypatch: Patch
) -> None:
    """Nobody knows how files differed from a commit that is not the current one."""
    monkeypatch.setattr(software, "read_origin", lambda: Origin("1.0", "a", True))
    monkeypatch.setattr(software, "read_patch", lambda: "a patch")
    pairs = zip(commits, dirty, strict=True)
    code = software.read_code([{"commit": commit, "dirty": flag} for commit, flag in pairs])
    assert (code.commits, code.changed, code.patch is not None) == (commits, any(dirty), patched)
