"""A fault in a part of any kind is one line with the class, the method and the file."""

import re
import shlex
import sys
from pathlib import Path

import pytest
from faulty_kinds import KINDS, OBJECTS, Kind, write_part

from evoros.cli.main import evoros
from evoros.terminal.console import DONE, INPUT, STOPPED

RUN = (
    *("executor=serial", "world=blocks", "course.time_limit_s=5", "failure=none", "figures=[]"),
    *("record=none", "optimizer.validation_trials=1"),
    *("optimizer=random_search", "optimizer.population_size=2", "optimizer.generations=1"),
)
CASES = [(name, head) for name, kind in KINDS.items() for head in kind.faults]


def choose_faults(name: str, head: str) -> list[str]:
    """Choose one fault of those that many methods can have, in turn, and all others.

    The same function checks the answers of all methods.
    """
    faults = KINDS[name].faults[head]
    common = [fault for fault in faults if fault in OBJECTS]
    others = [fault for fault in faults if fault not in OBJECTS]
    return [common[CASES.index((name, head)) % len(common)], *others]


def start(folder: Path, kind: Kind, method: str = "") -> int:
    """Run with a part that has a method in place of a right one; return the exit status."""
    words = write_part(folder, kind, method)
    return evoros(["--config-dir", str(folder), f"hydra.run.dir={folder / 'run'}", *RUN, *words])


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name, kind in KINDS.items() if not kind.mended])
def test_the_right_part_of_each_kind_runs(name: str, tmp_path: Path) -> None:
    assert start(tmp_path / f"right_{name.replace(' ', '_')}", KINDS[name]) == DONE


@pytest.mark.slow
@pytest.mark.parametrize(("name", "head"), CASES)
def test_a_fault_names_the_class_the_method_and_the_file(
    name: str, head: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    kind, method = KINDS[name], re.findall(r"def (\w+)", head)[0]
    for number, body in enumerate(choose_faults(name, head)):
        folder = tmp_path / re.sub(r"\W", "_", f"{name}_{method}_{number}")
        status = start(folder, kind, f"{head}:\n        {body}")
        lines = capsys.readouterr().err.splitlines()
        told = [line for line in lines if "Own" in line]
        assert len(told) == 1, (body, lines)
        assert re.search(rf"Own[.:]{method}\b", told[0]), told
        assert str(folder / f"own_{folder.name}.py") in told[0]
        if name == "observer":
            assert status == DONE
            assert "the run continues without this observer" in told[0]
            continue
        assert status in (INPUT, STOPPED), (body, lines)
        assert lines[-1] == told[0]
        assert kind.mended == ("evoros resume" in told[0]), told


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name, kind in KINDS.items() if kind.mended])
def test_a_run_goes_on_with_a_corrected_part_of_which_it_has_no_result(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It ends with the missions of a run that never had the fault, and is verified."""
    kind = KINDS[name]
    right, folder = tmp_path / f"right_{name[:3]}", tmp_path / f"mended_{name[:3]}"
    assert start(right, kind) == DONE
    (head,) = kind.faults
    assert start(folder, kind, f"{head}:\n        return 'x'") == INPUT
    line = capsys.readouterr().err.splitlines()[-1]
    write_part(folder, kind)
    del sys.modules[f"own_{folder.name}"]  # as in another process
    for _ in range(2):  # the second time, it is verified
        assert evoros(shlex.split(line.rpartition(": evoros ")[2])) == DONE
    one, other = (
        [row.rpartition(",")[0] for row in (path / "run/missions.csv").read_text().splitlines()]
        for path in (right, folder)
    )
    assert one == other
