"""Files that are lost or damaged by more than a bit: made again from the rest, or refused."""

import json
import random
from pathlib import Path

import pytest
from helpers import content, copied, everything, finished_run, reseal, resume

import evoros
from evoros.base.errors import InputError
from evoros.terminal.console import DONE, INPUT


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of three generations that was extended from two."""
    folder = finished_run(tmp_path_factory.mktemp("lost") / "run", "optimizer.generations=2")
    assert resume(folder, "optimizer.generations=3") == DONE
    return folder


@pytest.fixture
def folder(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    capsys.readouterr()
    return copied(run, tmp_path / "run")


@pytest.mark.parametrize("text", [None, "", "{}", '{"generations": 2}', "\xff"])
def test_an_extended_run_that_loses_its_status_is_not_shortened(
    text: str | None, folder: Path, run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    status = folder / "status.json"
    status.unlink() if text is None else status.write_text(text, encoding="latin-1")
    assert resume(folder) == DONE
    assert f"{status}: missing or damaged; the run continues to 3" in capsys.readouterr().err
    assert content(folder) == content(run)
    assert json.loads(status.read_text())["generations_done"] == 3


def test_a_table_that_goes_on_is_not_forgotten_by_an_older_status(folder: Path, run: Path) -> None:
    status = json.loads((folder / "status.json").read_text())
    (folder / "status.json").write_text(json.dumps(status | {"generations": 2}))
    reseal(folder)
    assert resume(folder) == DONE
    assert content(folder) == content(run)


@pytest.mark.parametrize(
    "name",
    ["missions.csv", "setting.json", "digests.csv", "generations/00001.csv", "champion/robot.urdf"],
)
def test_a_file_that_was_deleted_is_made_again(name: str, folder: Path, run: Path) -> None:
    (folder / name).unlink()
    if name.startswith(("missions", "digests", "generations")):
        with pytest.raises(InputError, match=name):
            evoros.load_run(folder)
    assert resume(folder) == DONE
    assert everything(folder).keys() == everything(run).keys()
    assert (folder / name).read_bytes() == (run / name).read_bytes()
    assert content(folder) == content(run)


def test_all_damaged_rows_are_named_and_what_was_there_is_kept(
    folder: Path, run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = folder / "missions.csv"
    lines = table.read_bytes().split(b"\n")
    lines[2] = lines[2].replace(b"selection", b"whatever")
    lines[4] = lines[4][:40]
    lines[7] = b"\xff" * 20
    table.write_bytes(b"\n".join(lines))
    with pytest.raises(
        InputError, match=r"missions\.csv: line 3: has changed since evoros wrote it"
    ):
        evoros.load_run(folder)
    assert resume(folder) == DONE
    (line,) = (line for line in capsys.readouterr().err.splitlines() if "missions.csv" in line)
    assert f"{table}: line 3, 5, 8: damaged" in line
    kept = (folder / "damaged" / "missions.csv").read_bytes()
    assert kept.split(b"\n") == [lines[2], lines[4], lines[7], b""]
    assert content(folder) == content(run)


@pytest.mark.parametrize("at", ["header", "middle", "end"])
def test_blocks_of_zeros_are_damaged_rows(at: str, folder: Path, run: Path) -> None:
    """As a file system may leave what was not yet on the disk."""
    table = folder / "missions.csv"
    rows = bytearray(table.read_bytes())
    begin = {"header": 0, "middle": len(rows) // 2, "end": len(rows) - 512}[at]
    rows[begin : begin + 512] = bytes(512)
    table.write_bytes(bytes(rows))
    assert resume(folder) == DONE
    assert content(folder) == content(run)


@pytest.mark.parametrize("name", ["generations/00000.csv", "champion/design.csv"])
def test_bytes_that_are_no_text_are_named_and_mended(
    name: str, folder: Path, run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (folder / name).read_bytes()
    at = text.index(b"\n", text.index(b"\n") + 1) + 3
    (folder / name).write_bytes(text[:at] + b"\xe9" + text[at + 1 :])
    with pytest.raises(InputError, match=f"{name}: line 3: has changed since evoros wrote it"):
        evoros.load_run(folder)
    assert resume(folder) == DONE
    assert f"{folder / name}: line 3: damaged" in capsys.readouterr().err
    assert content(folder) == content(run)


@pytest.mark.parametrize("bits", [1, 3])
@pytest.mark.parametrize("name", ["config.yaml", "manifest.json"])
def test_what_cannot_be_made_again_is_refused_untouched(
    name: str, bits: int, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rng, damaged = random.Random(1), bytearray((folder / name).read_bytes())
    for at in rng.sample(range(len(damaged)), bits):
        damaged[at] ^= 4
    (folder / name).write_bytes(bytes(damaged))
    before = everything(folder)
    with pytest.raises(InputError) as refusal:
        evoros.load_run(folder)
    assert resume(folder) == INPUT
    (line,) = capsys.readouterr().err.splitlines()
    assert line == f"evoros: {refusal.value}"
    assert line.startswith(f"evoros: {folder / name}")
    assert line.endswith("restore it from a copy, and leave the other files as they are")
    assert everything(folder) == before
