"""Any bit of a folder may flip: it is noticed and named, or has no effect, and nothing is lost."""

import random
import shutil
from pathlib import Path

import pytest
from damages import flip, kinds, read_all
from fixture_types import Capture, Folders
from helpers import copied, cut, everything, resume, scored, tiny

from evoros.base.errors import InputError
from evoros.storage.layout import SIZE, compute_digest, unseal_json
from evoros.terminal.console import DONE, INPUT

FREE = ("evoros.log", "status.json", "damaged", "figures")
"""Files that say when and how long, those that were damaged, and those that are drawn anew."""


def lasting(folder: Path) -> dict[str, bytes]:
    return {n: content for n, content in everything(folder).items() if not n.startswith(FREE)}


@pytest.fixture(scope="module")
def run(tmp_path_factory: Folders) -> Path:
    folder = tmp_path_factory.mktemp("bad") / "run"
    assert tiny(folder, "optimizer.generations=2", "record=all") == DONE
    return folder


@pytest.fixture(scope="module")
def begun(run: Path, tmp_path_factory: Folders) -> Path:
    """The run, as a kill leaves it."""
    folder = copied(run, tmp_path_factory.mktemp("begun") / "run")
    cut(folder, (run / "missions.csv").stat().st_size * 2 // 3)
    return folder


@pytest.fixture(scope="module")
def scores(run: Path, tmp_path_factory: Folders) -> Path:
    return scored(tmp_path_factory.mktemp("scores") / "scores", run, "trials=2", "record=all")


def check_analysis(name: str, folder: Path, whole: Path) -> bool:
    """Return whether it is noticed; if not, it must have no effect."""
    try:
        content = read_all(folder)
    except InputError as error:
        line = str(error)
        assert str(folder / name) in line or Path(name).parts[0] == "trajectories", (name, line)
        assert "\n" not in line
        return True
    if name.split("/")[0] not in ("trajectories",) or name.endswith(".csv"):
        assert content == read_all(whole), name
    return False


def check_resume(name: str, folder: Path, end: Path, capsys: Capture, noticed: bool) -> None:
    """It is mended, and the folder ends as it would have; or one line names the file.

    A row that a kill has cut off has no effect, whatever its bits are.
    """
    before = everything(folder)
    capsys.readouterr()
    status = resume(folder)
    lines = capsys.readouterr().err.splitlines()
    if status == DONE:
        assert lasting(folder) == lasting(end), name
        unused = name == "status.json" and (folder / "designs_in.csv").exists()
        unused = unused or (name == "missions.csv" and not noticed)
        assert unused or any(str(folder / name) in line for line in lines), name
        return
    assert status == INPUT
    assert str(folder / name) in lines[-1], lines
    assert {**everything(folder), "evoros.log": b""} == {**before, "evoros.log": b""}


CASES = {
    "a finished run": ("run", "run"),
    "a run that was killed": ("begun", "run"),
    "an evaluation": ("scores", "scores"),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_a_flipped_bit_in_any_kind_of_file_loses_nothing(
    case: str, request: pytest.FixtureRequest, tmp_path: Path, capsys: Capture
) -> None:
    begin, end = CASES[case]
    whole, ended = request.getfixturevalue(begin), request.getfixturevalue(end)
    names = [names[-1] for names in kinds(whole).values()]
    assert len(names) > 3
    for name in names:
        folder = copied(whole, tmp_path / "run")
        damaged = flip((folder / name).read_bytes(), random.Random(name))
        (folder / name).write_bytes(damaged)
        noticed = check_analysis(name, folder, whole)
        check_resume(name, folder, ended, capsys, noticed)
        shutil.rmtree(folder)


def test_a_list_with_a_right_digest_is_no_sealed_object() -> None:
    blank = b'[{"digest": "%b"}]' % (b"-" * SIZE)
    content = blank.replace(b"-" * SIZE, compute_digest(blank, b"status.json").encode())
    with pytest.raises(ValueError, match="it is not a JSON object"):
        unseal_json("status.json", content)
