"""Runs and evaluations after a power cut: nothing that was used is lost, whatever the disk kept."""

import os
import random
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from helpers import TINY, everything, resume, tiny
from power_cuts import Cut, Disk

from evoros.cli.evaluate import evaluate
from evoros.terminal.console import DONE

CHANGING = ("evoros.log", "status.json")
"""Files that tell when and how long; all others must have the same bytes."""


def lasting(folder: Path) -> dict[str, bytes]:
    """The files that must be the same whatever happened."""
    return {
        name: content
        for name, content in everything(folder).items()
        if not name.startswith(CHANGING) and not name.startswith("figures")
    }


@dataclass(frozen=True)
class Recorded:
    """A command's folder, and the power cuts that may have come before each of its syncs."""

    folder: Path
    cuts: list[Cut]
    end: Cut


def start_run(folder: Path) -> int:
    return tiny(folder, "optimizer.generations=2")


def start_evaluation(folder: Path) -> int:
    designs = folder.parent.parent.parent / "designs"
    options = ("executor=serial", "trials=2", f"designs={designs}", f"hydra.run.dir={folder}")
    return evaluate([*TINY, *options])


COMMANDS = {"run": start_run, "evaluation": start_evaluation}


@pytest.fixture(scope="module", params=COMMANDS)
def recorded(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Recorded]:
    begin = COMMANDS[request.param]
    base = tmp_path_factory.mktemp(request.param)
    assert tiny(base / "designs", "optimizer.generations=1") == DONE
    root = base / "disk"
    root.mkdir()
    disk = Disk(root)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", disk.fsync)
        assert begin(root / "runs" / "one") == DONE
    yield Recorded(root / "runs" / "one", disk.cuts, disk.cut())
    disk.close()


def mend(recorded: Recorded, cut: Cut, disk: Path) -> None:
    """Continue after a power cut, or start anew if no mission had been run."""
    begun = any(table.count(b"\n") > 1 for table in tables(cut))
    folder = disk / "runs" / "one"
    if not (folder / "missions.csv").exists():
        assert not begun
        return
    assert resume(folder) == DONE
    assert lasting(folder) == lasting(recorded.folder)


def tables(cut: Cut) -> Iterator[bytes]:
    """The tables of missions at a cut."""
    for names in cut.written.names.values():
        if "missions.csv" in names:
            yield cut.written.contents[names["missions.csv"]]


def test_what_a_command_has_finished_is_on_the_disk_itself(
    recorded: Recorded, tmp_path: Path
) -> None:
    left = recorded.end.restore(tmp_path / "disk") / "runs" / "one"
    assert lasting(left) == lasting(recorded.folder)


@pytest.mark.parametrize("seed", [None, 0])
def test_a_power_cut_at_some_moments_loses_nothing(
    seed: int | None, recorded: Recorded, tmp_path: Path
) -> None:
    step = max(1, len(recorded.cuts) // 3)
    for index in range((seed or 0) % step, len(recorded.cuts), step):
        cut_and_mend(recorded, index, seed, tmp_path)


@pytest.mark.slow
def test_a_power_cut_at_any_moment_loses_nothing(recorded: Recorded, tmp_path: Path) -> None:
    for index in range(len(recorded.cuts)):
        for seed in (None, *range(10, 14)):
            cut_and_mend(recorded, index, seed, tmp_path)


def cut_and_mend(recorded: Recorded, index: int, seed: int | None, folder: Path) -> None:
    rng = None if seed is None else random.Random(1000 * seed + index)
    cut = recorded.cuts[index]
    mend(recorded, cut, cut.restore(folder / f"{index}-{seed}", rng))
