"""Only files that a run has written are read: no copy, no other table, nothing outside."""

import shutil
from pathlib import Path

import pytest
from helpers import copied, everything, resume, tiny

from evoros.analysis.tables.loading import load_study
from evoros.base.errors import InputError
from evoros.cli.main import evoros
from evoros.storage.digests import Entry, read_entries, write_entries
from evoros.storage.reading import load_run
from evoros.terminal.console import DONE

SHORT = "optimizer.generations=2"


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("strays") / "run"
    assert tiny(folder, SHORT) == DONE
    return folder


@pytest.mark.parametrize("name", ["00001 (1).csv", "00001.sync-conflict-20260101.csv", "00002.csv"])
def test_a_table_that_the_run_has_not_written_changes_no_mean_and_is_named(
    name: str, run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = copied(run, tmp_path / "run")
    stray = folder / "generations" / name
    stray.write_text((run / "generations" / "00000.csv").read_text())
    assert load_run(folder).generations.equals(load_run(run).generations)
    assert evoros(["analyze", "fitness", str(folder), "--output", str(tmp_path)]) == DONE
    assert resume(folder) == DONE
    lines = [line for line in capsys.readouterr().err.splitlines() if str(stray) in line]
    assert len(lines) == 2
    assert all(line.endswith("ignored, because the run did not write it") for line in lines)
    assert load_run(folder).generations.equals(load_run(run).generations)


@pytest.mark.slow
def test_an_extended_run_sets_a_stray_table_aside(run: Path, tmp_path: Path) -> None:
    folder, whole = copied(run, tmp_path / "run"), tmp_path / "whole"
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
def test_a_digest_leads_nowhere_outside(name: str, run: Path, tmp_path: Path) -> None:
    folder = copied(run, tmp_path / "run")
    entries = read_entries((folder / "digests.csv").read_bytes()).by_name
    entries = {**entries, name: Entry("0" * 64, "")}
    (folder / "digests.csv").write_text(write_entries(entries))
    line = len(entries) + 1
    with pytest.raises(
        InputError, match=rf"digests\.csv: line {line}: has changed since evoros wrote it"
    ):
        load_run(folder)
    assert resume(folder) == DONE
    assert load_run(folder).generations.equals(load_run(run).generations)
    assert name not in (folder / "digests.csv").read_text()


def test_another_table_in_place_of_the_digests_costs_its_own_run_alone(
    run: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    good, bad = copied(run, tmp_path / "good"), copied(run, tmp_path / "bad")
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
