"""The harness of faults finds a fault that is planted, and a case follows from its seed."""

import shutil
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path

import cases
import counting
import damages
import hostile
import kills
import power_cuts
import pytest
from cases import FAULT, SAME, Fault, Trial, run_cases
from helpers import copied, everything, finished_run, reseal

from evoros.files import disk
from evoros.terminal.console import DONE, INPUT, report_error
from evoros.terminal.log import log_to_terminal


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return finished_run(tmp_path_factory.mktemp("harness") / "run", "optimizer.generations=1")


def change_a_digit(folder: Path) -> Path:
    """Change a mission as a fault of evoros would: with right digests."""
    table = folder / "missions.csv"
    header, row, *rows = table.read_text().splitlines()
    at = row.index(".") + 1
    changed = row[:at] + str((int(row[at]) + 1) % 10) + row[at + 1 :]
    table.write_text("\n".join([header, changed, *rows, ""]))
    return reseal(folder)


def test_another_digit_of_a_mission_is_a_fault(run: Path, tmp_path: Path) -> None:
    whole = cases.lasting(run)
    cases.check_same(run, whole)
    cases.check_equal(run, run)
    changed = change_a_digit(copied(run, tmp_path / "run"))
    with pytest.raises(Fault, match=r"missions\.csv: other bytes"):
        cases.check_same(changed, {**whole, "digests.csv": (changed / "digests.csv").read_bytes()})
    with pytest.raises(Fault):
        cases.check_equal(changed, run)


@pytest.mark.parametrize("name", ["missions.csv", "champion/design.csv"])
def test_a_file_too_few_or_too_many_is_a_fault(name: str, run: Path, tmp_path: Path) -> None:
    folder = copied(run, tmp_path / "run")
    (folder / name).rename(folder / f"{name}.csv")
    with pytest.raises(Fault, match=rf"{name}: missing|{name}\.csv: new"):
        cases.check_same(folder, cases.lasting(run))


def print_a_traceback() -> int:
    print("Traceback (most recent call last):\nKeyError: 'x'", file=sys.stderr)
    return INPUT


def clear_the_terminal() -> int:
    print("\x1b[2J")
    return DONE


def refuse(line: str = "folder: must be another one; choose it") -> int:
    with log_to_terminal():
        return report_error("evoros", line, INPUT)


def test_what_a_command_says_is_judged(run: Path) -> None:
    before = everything(run)
    cases.check_refusal(cases.call(refuse), run, before)
    with pytest.raises(Fault, match="a traceback: KeyError"):
        cases.call(print_a_traceback)
    with pytest.raises(Fault, match="reaches the terminal"):
        cases.call(clear_the_terminal)
    for status in (DONE, INPUT):
        with pytest.raises(Fault, match=f"status {status}"):
            cases.check_refusal(cases.Answer(status, "", ""), run, before)


def test_only_python_itself_may_answer_ctrl_c_with_a_traceback() -> None:
    head = "Traceback (most recent call last):"
    python = f'{head}\n  File "<frozen site>", line 584, in main\nKeyboardInterrupt\n'
    ours = f'{head}\n  File "evoros/cli/command.py", line 9, in create\nKeyboardInterrupt\n'
    assert kills.is_before_evoros(python)
    assert not kills.is_before_evoros(ours)
    assert not kills.is_before_evoros(python.replace("KeyboardInterrupt", "OSError: odd"))


def test_a_refusal_that_loses_something_is_a_fault(run: Path, tmp_path: Path) -> None:
    folder, before = copied(run, tmp_path / "run"), everything(run)
    (folder / "generations" / "00000.csv").unlink()
    with pytest.raises(Fault, match=r"00000\.csv: lost by a command that refuses"):
        cases.check_refusal(cases.call(refuse), folder, before)


def fail() -> str:
    raise KeyError("planted")


FAULTS: dict[str, Callable[[], object]] = {
    "a traceback: KeyError: 'planted'": fail,
    "takes longer than 0.1 s": lambda: time.sleep(30),
    "a traceback: MemoryError": lambda: bytearray(2 * cases.MEMORY),
}


@pytest.mark.parametrize("about", FAULTS)
def test_a_case_that_fails_hangs_or_takes_all_memory_is_a_fault(about: str, tmp_path: Path) -> None:
    trial = Trial("planted", lambda: str(FAULTS[about]()))
    result = cases.try_case(
        lambda seed, folder: trial, 7, tmp_path, 0.1 if "0.1" in about else 100.0
    )
    assert result.verdict == FAULT
    assert result.about.startswith(about)


def test_a_fault_is_counted_and_named_with_its_seed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    @contextmanager
    def prepare(base: Path) -> Iterator[Callable[[int, Path], Trial]]:
        yield lambda seed, folder: Trial("planted", lambda: fail() if seed == 3 else SAME)

    monkeypatch.setattr(power_cuts, "prepare", prepare)
    table = tmp_path / "table.csv"
    assert counting.main(["power_cuts", "--count", "3", "--table", str(table)]) == 0
    assert counting.main(["power_cuts", "--count", "5", "--table", str(table)]) == 1
    assert "power_cuts 3: planted: fault a traceback: KeyError" in capsys.readouterr().out
    assert [row.split(",")[3] for row in table.read_text().splitlines()[1:]] == [
        *[SAME] * 3,
        FAULT,
        SAME,
    ]
    assert counting.main(["power_cuts", "--case", "3"]) == 1
    assert counting.main(["power_cuts", "--case", "4"]) == 0


def test_a_run_that_does_not_sync_its_folders_is_a_fault(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in ("storage.run_folder", "storage.creation", "storage.mission_table"):
        monkeypatch.setattr(f"evoros.{module}.sync", lambda path: None, raising=False)
    monkeypatch.setattr(disk, "sync", lambda path: None)
    with pytest.raises(Fault, match="missing"):
        power_cuts.record("run", power_cuts.COMMANDS["run"], tmp_path / "disk")


def files(folder: Path) -> dict[str, object]:
    """What is there, apart from where links lead: to folders of the case."""
    return {
        name: "a link" if isinstance(content, Path) else content
        for name, content in hostile.snapshot(folder).items()
    }


@pytest.mark.parametrize("kind", [damages, hostile])
def test_a_case_is_a_function_of_its_seed(
    kind: object, run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Preparing is cheap here: each folder that a case damages is one run."""
    for name in ("tiny", "scored", "sweep"):
        monkeypatch.setattr(kind, name, lambda folder, *more: copied(run, folder) and DONE, False)
    monkeypatch.setattr(damages, "cut", lambda folder, size: None)
    (tmp_path / "shared").mkdir()
    with kind.prepare(tmp_path / "shared") as plan:  # type: ignore[attr-defined]
        for seed in range(20):
            first, second = tmp_path / f"{seed}", tmp_path / f"{seed} again"
            first.mkdir()
            second.mkdir()
            assert plan(seed, first).case == plan(seed, second).case
            one, other = (files(folder / "run") for folder in (first, second))
            assert one == other


def test_a_mended_folder_that_says_nothing_is_a_fault(run: Path, tmp_path: Path) -> None:
    folder = copied(run, tmp_path / "run")
    (folder / "setting.json").write_text("{}")

    def mend(path: Path) -> int:
        shutil.copy(run / "setting.json", path / "setting.json")
        return DONE

    silent = damages.Subject(run, run, mend)
    with pytest.raises(Fault, match=r"setting\.json: mended without a word"):
        damages.judge(silent, folder, "setting.json")


SEEDS: dict[str, Sequence[int]] = {"hostile": (113, 115, 116, 124, 127, 131), "fuzz": range(20)}
MORE: dict[str, Sequence[int]] = {
    "power_cuts": (1, 5, 6, 8, *range(1002, 1008), 1010, 1011),  # of all commands
    "damages": (41, 43, 45),  # of a sweep, a killed run and an evaluation
    "hostile": (114, 117, 119, 121, 125, 129),
    "fuzz": (*range(20, 40), *range(1000, 1020)),
    "kills": (2,),  # three times with two workers
}


def list_faults(name: str, seeds: Sequence[int]) -> list[str]:
    module = import_module(name)
    results = list(run_cases(module.prepare, seeds, 5 * module.LIMIT_S))
    assert len(results) == len(seeds)
    return [f"{name} {seed}: {result}" for seed, result in results if result.verdict == FAULT]


@pytest.mark.parametrize("name", SEEDS)
def test_some_faults_of_each_kind_lose_nothing(name: str) -> None:
    assert list_faults(name, SEEDS[name]) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", MORE)
def test_more_faults_of_each_kind_lose_nothing(name: str) -> None:
    assert list_faults(name, MORE[name]) == []
