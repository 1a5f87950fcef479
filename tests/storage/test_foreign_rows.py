"""Rows that are not of the run are set aside, and the table becomes what it was, by its bytes."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from fixture_types import Capture, Folders
from helpers import copied, everything, renew_digests, resume, scored, tiny
from hypothesis import given
from hypothesis import strategies as st

from evoros.base.errors import InputError
from evoros.storage.digests import describe_growing
from evoros.storage.layout import seal_rows
from evoros.storage.reading import load_run
from evoros.storage.run_key import conceal, derive_key, read_key
from evoros.terminal.console import DONE

SHORT = ("optimizer.generations=2", "figures=[]")
FASTER = "controller.navigation.speed_mps=0.28"
Edit = Callable[[list[bytes], bytes], list[bytes]]


@pytest.fixture(scope="module")
def folders(tmp_path_factory: Folders) -> dict[str, tuple[Path, Path]]:
    """A run and an evaluation, each with another of the same seed and missions."""
    base = tmp_path_factory.mktemp("foreign")
    assert tiny(base / "run", *SHORT) == DONE
    assert tiny(base / "other", *SHORT, FASTER) == DONE
    for name, more in (("scores", []), ("others", [FASTER])):
        scored(base / name, base / "run", "trials=3", *more)
    return {"run": (base / "run", base / "other"), "scores": (base / "scores", base / "others")}


def read_rows(folder: Path) -> list[bytes]:
    return (folder / "missions.csv").read_bytes().splitlines(keepends=True)


EDITS: dict[str, tuple[Edit, str]] = {
    "pasted": (lambda rows, foreign: [*rows[:3], foreign, *rows[4:]], "line 4: damaged"),
    "added": (lambda rows, foreign: [*rows, foreign], "damaged"),
    "cut at its end": (lambda rows, _: rows[:-3], "missions without rows will be rerun"),
    "cut in the middle": (
        lambda rows, _: [*rows[:4], *rows[6:]],
        "missions without rows will be rerun",
    ),
    "cut in its last row": (lambda rows, _: [*rows[:-1], rows[-1][:-9]], "damaged"),
    "with junk at its end": (lambda rows, _: [*rows, b"\xd3junk"], "damaged"),
    "repeated": (lambda rows, _: [*rows[:4], rows[2], *rows[4:]], "line 5: damaged"),
    "in another order": (lambda rows, _: [rows[0], *rows[:0:-1]], "changed since it was"),
}


def check(folder: Path, whole: Path, said: str, capsys: Capture) -> None:
    """A reader refuses the table, resuming mends it and says so, and nothing is lost."""
    before = set(read_rows(folder))
    with pytest.raises(InputError, match=r"missions\.csv"):
        load_run(folder)
    capsys.readouterr()
    assert resume(folder) == DONE
    told = [line for line in capsys.readouterr().err.splitlines() if "missions.csv" in line]
    assert said in told[0]
    free = ("damaged", "evoros.log", "status.json")
    mended = {n: content for n, content in everything(folder).items() if not n.startswith(free)}
    assert mended == {n: everything(whole)[n] for n in mended}
    kept = [file.read_bytes() for file in (folder / "damaged").glob("*")]
    assert before - set(read_rows(folder)) <= set(b"".join(kept).splitlines(keepends=True))
    load_run(folder)


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        *((name, "run") for name in EDITS),
        *((name, "scores") for name in ("pasted", "cut in the middle", "in another order")),
    ],
)
def test_a_table_of_missions_is_mended_with_a_word(
    name: str, kind: str, folders: dict[str, tuple[Path, Path]], tmp_path: Path, capsys: Capture
) -> None:
    whole, other = folders[kind]
    folder = copied(whole, tmp_path / "copy")
    edit, said = EDITS[name]
    foreign = read_rows(other)[3]
    assert foreign not in read_rows(whole)
    (folder / "missions.csv").write_bytes(b"".join(edit(read_rows(folder), foreign)))
    check(folder, whole, said, capsys)


@pytest.mark.parametrize("kind", ["run", "scores"])
def test_the_status_of_another_run_is_not_believed(
    kind: str, folders: dict[str, tuple[Path, Path]], tmp_path: Path
) -> None:
    whole, other = folders[kind]
    folder = copied(whole, tmp_path / "copy")
    (folder / "status.json").write_bytes((other / "status.json").read_bytes())
    with pytest.raises(InputError, match=r"status\.json \(it is from another run\)"):
        load_run(folder)
    assert resume(folder) == DONE
    load_run(folder)


def test_digests_that_lack_a_generation_are_damaged(
    folders: dict[str, tuple[Path, Path]], tmp_path: Path, capsys: Capture
) -> None:
    """Otherwise analysis would read a shorter run."""
    folder = copied(folders["run"][0], tmp_path / "copy")
    before = (folder / "digests.csv").read_bytes()
    rows = before.splitlines(keepends=True)
    (lost,) = (row for row in rows if row.startswith(b"generations/00001.csv"))
    (folder / "digests.csv").write_bytes(before.replace(lost, b""))
    with pytest.raises(
        InputError, match=r"digests\.csv \(the table of a generation is not listed\)"
    ):
        load_run(folder)
    capsys.readouterr()
    for words in (1, 0):
        assert resume(folder) == DONE
        assert (folder / "digests.csv").read_bytes() == before
        assert capsys.readouterr().err.count("digests.csv: has changed since it was") == words


@pytest.mark.parametrize("kind", ["run", "scores"])
def test_a_row_that_was_not_asked_for_is_set_aside(
    kind: str, folders: dict[str, tuple[Path, Path]], tmp_path: Path, capsys: Capture
) -> None:
    whole, _ = folders[kind]
    folder = copied(whole, tmp_path / "copy")
    key = read_key(json.loads((folder / "manifest.json").read_text()))
    cells = read_rows(folder)[1].decode().split(",")[:-1]
    extra = seal_rows(",".join([*cells[:3], "77", *cells[4:]]) + "\n", key)
    (folder / "missions.csv").write_bytes(b"".join([*read_rows(folder), extra]))
    said = "of missions that the run does not request"
    before = len(read_rows(folder))
    capsys.readouterr()
    with pytest.raises(InputError, match=r"missions\.csv"):
        load_run(folder)
    assert resume(folder) == DONE
    lines = [line for line in capsys.readouterr().err.splitlines() if f": line {before}: " in line]
    assert len(lines) == 1
    assert said in lines[0]
    assert read_rows(folder) == read_rows(whole)
    assert (folder / "damaged" / "missions.csv").read_bytes() == extra


@pytest.mark.parametrize("kind", ["run", "scores"])
def test_an_unfinished_table_is_read_without_foreign_rows_or_repeated_ones(
    kind: str, folders: dict[str, tuple[Path, Path]], tmp_path: Path
) -> None:
    whole, other = folders[kind]
    rows = read_rows(whole)
    for index, extra in enumerate((rows[1], read_rows(other)[2])):
        folder = copied(whole, tmp_path / f"{index}")
        (folder / "missions.csv").write_bytes(b"".join([*rows, extra]))
        renew_digests(folder, missions=describe_growing(rows[0]))
        with pytest.raises(InputError, match=rf"missions\.csv: line {len(rows) + 1}: "):
            load_run(folder)


@pytest.mark.slow
def test_equal_runs_have_equal_bytes_and_other_runs_another_key(
    folders: dict[str, tuple[Path, Path]], tmp_path: Path
) -> None:
    """It runs on workers, is extended, and keeps other trajectories."""
    run, _ = folders["run"]
    again = tmp_path / "again"
    assert tiny(again, "optimizer.generations=1", "record=none") == DONE
    workers = ["executor=processes", "executor.workers=1"]
    assert resume(again, "optimizer.generations=2", *workers) == DONE
    assert read_rows(again) == read_rows(run)
    paths = [folder / "manifest.json" for pair in folders.values() for folder in pair]
    keys = {read_key(json.loads(path.read_text())) for path in paths}
    assert len(keys) == len(paths)
    assert b"" not in keys


@given(st.integers(-(10**9), 10**9))
def test_a_number_has_one_key_however_it_was_typed(number: int) -> None:
    keys = {derive_key({"limit": [value]}, {}) for value in (number, float(number))}
    assert len(keys) == 1
    assert keys != {derive_key({"limit": [number + 1]}, {})}


def test_a_key_has_no_value_of_the_environment() -> None:
    config = "pin: ${oc.env:PIN}\nalso: {in: ['${pin}', 1]}\nobservers: {a: b}\nseed: "
    keys = {
        derive_key(conceal({"pin": pin, "also": {"in": [pin, 1]}, "seed": s}, f"{config}{s}"), {})
        for pin in ("1234", "0815")
        for s in (3, 4)
    }
    assert len(keys) == 2


def test_a_secret_of_an_observer_leaves_the_key_as_it_is() -> None:
    values = {"seed": 3, "also": 3}
    plain, secret = "seed: 3\nalso: ${seed}", "\nobservers: {token: '${oc.env:PIN}'}"
    watched = {**values, "observers": {"token": "1234"}}
    assert conceal(values, plain) == values
    assert derive_key(values, {}) == derive_key(conceal(watched, plain + secret), {})
