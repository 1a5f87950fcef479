"""Only what a run has written is read, bounded; one line names what is not."""

import os
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
from fixture_types import Capture, Folders, Patch
from helpers import copied, everything, finished_run, reseal, resume, tiny

from evoros.analysis.command import evoros_analyze
from evoros.analysis.tables.loading import load_study
from evoros.base.errors import InputError
from evoros.cli.diff import diff
from evoros.cli.main import evoros
from evoros.files.disk import LARGE, SMALL, hash_regular, read_regular
from evoros.files.nested import EXPANDED, read_yaml
from evoros.storage.digests import Entry, read_entries, write_entries
from evoros.storage.reading import load_run
from evoros.storage.run_folder import RunFolder
from evoros.terminal.console import DONE, INPUT, STOPPED

DEEP = 100_000


@pytest.fixture(scope="module")
def run(tmp_path_factory: Folders) -> Path:
    return finished_run(tmp_path_factory.mktemp("bounds") / "run", "optimizer.generations=1")


def enlarge(path: Path, size: int) -> None:
    """Make it a sparse file, which needs no room on the disk."""
    with path.open("ab") as file:
        file.truncate(size)


@pytest.mark.parametrize(
    ("name", "size"),
    [
        ("manifest.json", SMALL + 1),
        ("status.json", SMALL + 1),
        ("config.yaml", LARGE * 1000),
        ("digests.csv", LARGE * 1000),
        ("setting.json", LARGE * 1000),
        ("missions.csv", LARGE * 1000),
        ("generations/00000.csv", LARGE * 1000),
    ],
)
def test_a_huge_file_is_not_read(
    name: str, size: int, run: Path, tmp_path: Path, monkeypatch: Patch, capsys: Capture
) -> None:
    folder = copied(run, tmp_path / "run")
    digests = folder / "digests.csv"
    entries = read_entries(digests.read_bytes()).by_name
    if name in entries:  # as a table that grows, it has no hash that would have to be computed
        entries[name] = Entry("", "")
        digests.write_text(write_entries(entries))
    enlarge(folder / name, size)
    with pytest.raises(
        InputError, match=rf"{name}: cannot be read \(Larger than \d+ MiB\)|must be"
    ):
        load_run(folder)
    before = os.stat(folder / name).st_blocks
    capsys.readouterr()
    if name not in ("status.json", "digests.csv"):
        assert resume(folder) == INPUT
        (line,) = capsys.readouterr().err.splitlines()[-1:]
        assert name in line
    assert os.stat(folder / name).st_blocks == before


@pytest.mark.parametrize("read", [read_regular, hash_regular])
def test_only_regular_files_are_read(read: Callable[[Path], object], tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "link").symlink_to("/dev/zero")
    for place in (tmp_path / "pipe", tmp_path / "link", Path("/dev/zero"), tmp_path):
        with pytest.raises(OSError, match=r"regular|levels|directory"):
            read(place)


JSON_FILES = ("manifest.json", "status.json", "setting.json", "champion/certificate.json")


@pytest.mark.parametrize(
    ("name", "opening", "closing", "depth"),
    [*((name, "[", "]", DEEP) for name in JSON_FILES), ("setting.json", '{"a":', "}", 500)],
)
def test_json_that_is_nested_deep_costs_its_own_run_alone(
    name: str, opening: str, closing: str, depth: int, run: Path, tmp_path: Path, capsys: Capture
) -> None:
    good, bad = copied(run, tmp_path / "good"), copied(run, tmp_path / "ill")
    (bad / name).write_text(opening * depth + "1" + closing * depth)
    if name not in ("manifest.json", "status.json"):
        reseal(bad)
    shown = ["mission", str(bad), "--output", str(tmp_path / "out")]
    assert evoros_analyze(shown) == INPUT or name.startswith("champion")
    lines = [line for line in capsys.readouterr().err.splitlines() if str(bad / name) in line]
    assert len(lines) == 1 or name.startswith("champion")
    study = load_study([tmp_path])
    assert good in [record.path for record in study.records]
    assert diff([str(good), str(bad)]) != DONE


DEEP_YAML = {
    "lists": "[" * DEEP + "]" * DEEP,
    "mappings": "{a: " * DEEP + "1" + "}" * DEEP,
    "blocks": "\n" + "".join(f"{' ' * (depth + 1)}a:\n" for depth in range(500)),
    "an alias": "{a: &a [1, 1], b: *a}",
    "doubling references": "{"
    + ", ".join(f'a{n}: "${{note.a{n + 1}}}${{note.a{n + 1}}}"' for n in range(60))
    + ", a60: xx}",
    "doubling lists": "{"
    + ", ".join(
        f'b{n}: ["${{note.b{n + 1}}}", "${{.1}}", 2, "${{note.b{n + 1}}}"]' for n in range(60)
    )
    + ", b60: [1]}",
}


@pytest.mark.parametrize("name", DEEP_YAML)
def test_a_configuration_that_grows_as_it_is_read_is_one_line(
    name: str, run: Path, tmp_path: Path, capsys: Capture
) -> None:
    good, bad = copied(run, tmp_path / "good"), copied(run, tmp_path / "ill")
    with (bad / "config.yaml").open("a") as file:
        file.write(f"note: {DEEP_YAML[name]}\n")
    reseal(bad)
    commands: dict[str, Callable[[], int]] = {
        "resume": lambda: resume(bad),
        "diff": lambda: diff([str(bad), str(good)]),
        "analyze": lambda: evoros_analyze(["fitness", str(bad)]),
    }
    for command in commands.values():
        capsys.readouterr()
        assert command() == INPUT
        lines = capsys.readouterr().err.splitlines()
        assert str(bad / "config.yaml") in lines[0]
        assert all(len(line) < 1000 for line in lines)
    assert [record.path for record in load_study([tmp_path]).records] == [good]


def test_references_of_bundled_size_are_read(run: Path) -> None:
    tree, text = read_yaml(run / "config.yaml")
    assert isinstance(tree, dict)
    assert len(text) < EXPANDED


def test_a_hard_link_is_not_written_through(run: Path, tmp_path: Path) -> None:
    """A backup that shares its files stays as it is, and so does any other file."""
    folder = copied(run, tmp_path / "run")
    (folder / "champion" / "design.csv").unlink()
    for name in ("evoros.log", "missions.csv", "digests.csv"):
        os.link(folder / name, tmp_path / name)
    before = {name: (tmp_path / name).read_bytes() for name in ("evoros.log", "digests.csv")}
    assert resume(folder, "optimizer.generations=2") == DONE
    assert before == {name: (tmp_path / name).read_bytes() for name in before}
    assert (folder / "missions.csv").read_bytes() != (tmp_path / "missions.csv").read_bytes()
    assert (tmp_path / "missions.csv").read_bytes() == (run / "missions.csv").read_bytes()
    assert (folder / "evoros.log").read_bytes().startswith(before["evoros.log"])


# Files of another run or of another kind -----------------------------------------------------


@pytest.fixture(scope="module")
def other(run: Path) -> Path:
    folder = run.with_name("other")
    assert tiny(folder, "optimizer.generations=1", "seed=1") == DONE
    return folder


def test_a_manifest_of_another_run_is_named(
    run: Path, other: Path, tmp_path: Path, capsys: Capture
) -> None:
    folder = copied(run, tmp_path / "run")
    (folder / "manifest.json").write_bytes((other / "manifest.json").read_bytes())
    before = everything(folder)
    with pytest.raises(InputError, match=r"manifest\.json: the file is from another"):
        load_run(folder)
    capsys.readouterr()
    assert resume(folder) == INPUT
    (line,) = capsys.readouterr().err.splitlines()
    assert f"{folder / 'manifest.json'}: the file is from another run" in line
    assert everything(folder) == before


def test_digests_of_another_run_are_named_and_written_anew(
    run: Path, other: Path, tmp_path: Path, capsys: Capture
) -> None:
    folder = copied(run, tmp_path / "run")
    (folder / "digests.csv").write_bytes((other / "digests.csv").read_bytes())
    with pytest.raises(InputError, match=r"digests\.csv: the file is from another"):
        load_run(folder)
    capsys.readouterr()
    assert resume(folder) == DONE
    (line,) = [s for s in capsys.readouterr().err.splitlines() if "digests.csv" in s]
    assert "from another run" in line
    free = ("evoros.log", "status.json", "damaged")
    mended = {n: content for n, content in everything(folder).items() if not n.startswith(free)}
    assert mended == {n: everything(run)[n] for n in mended}
    assert not (folder / "damaged").exists()


@pytest.mark.parametrize(
    ("kind", "place"), [("manifest.json", "status.json"), ("status.json", "manifest.json")]
)
def test_a_sealed_file_of_another_kind_is_named(
    kind: str, place: str, run: Path, tmp_path: Path
) -> None:
    folder = copied(run, tmp_path / "run")
    (folder / place).write_bytes((folder / kind).read_bytes())
    with pytest.raises(
        InputError, match=rf"{place} \(it is a {kind}\): has changed since evoros wrote"
    ):
        load_run(folder)


def test_a_folder_that_is_moved_during_a_run_is_one_line_with_the_fix(
    run: Path, tmp_path: Path, monkeypatch: Patch, capsys: Capture
) -> None:
    folder, away = tmp_path / "run", tmp_path / "away"
    append = RunFolder.append

    def move(self: RunFolder, rows: Sequence[Sequence[object]]) -> list[int]:
        places = append(self, rows)
        if folder.is_dir() and len(self.rows) > 3:
            folder.rename(away)
        return places

    monkeypatch.setattr(RunFolder, "append", move)
    assert tiny(folder, "optimizer.generations=1") == STOPPED
    (line,) = capsys.readouterr().err.splitlines()[-1:]
    assert f"{folder}: moved or deleted during the run; move the folder back" in line
    assert f"type: evoros resume {folder}" in line
    away.rename(folder)
    assert resume(folder) == DONE
    assert (folder / "missions.csv").read_bytes() == (run / "missions.csv").read_bytes()


SHORT = "optimizer.generations=2"


@pytest.fixture(scope="module")
def stray_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return finished_run(tmp_path_factory.mktemp("strays") / "run", SHORT)


@pytest.mark.parametrize("name", ["00001 (1).csv", "00001.sync-conflict-20260101.csv", "00002.csv"])
def test_a_table_that_the_run_has_not_written_changes_no_mean_and_is_named(
    name: str, stray_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = copied(stray_run, tmp_path / "run")
    stray = folder / "generations" / name
    stray.write_text((stray_run / "generations" / "00000.csv").read_text())
    assert load_run(folder).generations.equals(load_run(stray_run).generations)
    assert evoros(["analyze", "fitness", str(folder), "--output", str(tmp_path)]) == DONE
    assert resume(folder) == DONE
    lines = [line for line in capsys.readouterr().err.splitlines() if str(stray) in line]
    assert len(lines) == 2
    assert all(line.endswith("ignored, because the run did not write this file") for line in lines)
    assert load_run(folder).generations.equals(load_run(stray_run).generations)


@pytest.mark.slow
def test_an_extended_run_sets_a_stray_table_aside(stray_run: Path, tmp_path: Path) -> None:
    folder, whole = copied(stray_run, tmp_path / "run"), tmp_path / "whole"
    stray = folder / "generations" / "00002.csv"
    shutil.copy(folder / "generations" / "00000.csv", stray)
    foreign = stray.read_bytes()
    assert resume(folder, "optimizer.generations=3") == DONE
    assert tiny(whole, "optimizer.generations=3") == DONE
    assert stray.read_bytes() == (whole / "generations" / "00002.csv").read_bytes()
    assert (folder / "damaged" / "generations" / "00002.csv").read_bytes() == foreign


@pytest.mark.parametrize(
    "name", ["generations/../../../../../../dev/zero", "/dev/zero", "generations/../config.yaml"]
)
def test_a_digest_leads_nowhere_outside(name: str, stray_run: Path, tmp_path: Path) -> None:
    folder = copied(stray_run, tmp_path / "run")
    entries = read_entries((folder / "digests.csv").read_bytes()).by_name
    entries = {**entries, name: Entry("0" * 64, "")}
    (folder / "digests.csv").write_text(write_entries(entries))
    line = len(entries) + 1
    with pytest.raises(
        InputError, match=rf"digests\.csv: line {line}: has changed since evoros wrote it"
    ):
        load_run(folder)
    assert resume(folder) == DONE
    assert load_run(folder).generations.equals(load_run(stray_run).generations)
    assert name not in (folder / "digests.csv").read_text()


def test_another_table_in_place_of_the_digests_costs_its_own_run_alone(
    stray_run: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    good, bad = copied(stray_run, tmp_path / "good"), copied(stray_run, tmp_path / "bad")
    shutil.copy(bad / "missions.csv", bad / "digests.csv")
    study = load_study([tmp_path])
    assert [record.path for record in study.records] == [good]
    (line,) = (line for line in caplog.messages if "left out" in line)
    assert f"{bad / 'digests.csv'}: line 1: has changed since evoros wrote it" in line
    assert resume(bad) == DONE
    free = ("damaged", "evoros.log", "status.json")
    ours, theirs = (
        {n: content for n, content in everything(folder).items() if not n.startswith(free)}
        for folder in (good, bad)
    )
    assert ours == theirs
