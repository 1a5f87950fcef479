"""Power cuts: a disk records what is durable before each sync of a command, and a cut leaves that.

The command is then typed again, or its run resumed, and has to end with the same bytes.
"""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from random import Random
from unittest import mock

from cases import SAME, Fault, Trial, call, check_equal, check_same, lasting, prepare_quietly
from disk import Cut, Disk
from helpers import cut, resume, scored, sweep, tiny

from evoros.terminal.console import DONE

LIMIT_S = 60.0
TWO, THREE = "optimizer.generations=2", "optimizer.generations=3"
ALL_LOST = 0.1  # share of the cuts that lose all they may


@dataclass(frozen=True)
class Command:
    """A command in a folder: before it, itself, and afterwards."""

    begin: Callable[[Path], object]
    again: Callable[[Path], int] = resume
    before: Callable[[Path], object] = lambda folder: None


@dataclass(frozen=True)
class Recorded:
    """A command, the cuts that may come before each of its syncs, and its lasting files."""

    name: str
    command: Command
    cuts: list[Cut]
    whole: dict[str, bytes]
    folder: Path


def evaluate_champion(folder: Path) -> object:
    """Evaluate a run that is beside the disk."""
    designs = folder.parents[2] / "designs"
    if not designs.exists():
        assert tiny(designs, "optimizer.generations=1") == DONE
    return scored(folder, designs, "trials=2", "record=all")


def kill(folder: Path) -> None:
    """Leave what a kill leaves."""
    tiny(folder, TWO)
    cut(folder, (folder / "missions.csv").stat().st_size * 2 // 3)


def damage(folder: Path) -> None:
    """Damage a file of each kind that can be made again."""
    tiny(folder, TWO, "record=all")
    tables = [folder / name for name in ("missions.csv", "generations/00001.csv")]
    kept = sorted((folder / "trajectories").rglob("*_near_0000.csv"))[0]
    for path in (*tables, kept, folder / "champion" / "design.csv"):
        content = bytearray(path.read_bytes())
        content[len(content) // 2] ^= 1
        path.write_bytes(content)


COMMANDS = {
    "run": Command(lambda folder: tiny(folder, TWO)),
    "run with a figure": Command(lambda folder: tiny(folder, TWO, "figures=[fitness]")),
    "run that keeps all": Command(lambda folder: tiny(folder, TWO, "record=all")),
    "resumed run": Command(resume, before=kill),
    "extended run": Command(
        lambda folder: resume(folder, THREE),
        lambda folder: resume(folder, THREE),
        lambda folder: tiny(folder, TWO),
    ),
    "mended run": Command(resume, before=damage),
    "evaluation": Command(evaluate_champion),
    "sweep": Command(lambda folder: sweep(folder, "seed=0,1"), lambda f: sweep(f, "seed=0,1")),
}


@contextmanager
def prepare(base: Path) -> Iterator[Callable[[int, Path], Trial]]:
    """Record each command once."""
    recorded: dict[str, Recorded] = {}

    def plan(seed: int, folder: Path) -> Trial:
        rng = Random(f"power cut {seed}")
        name = rng.choice(list(COMMANDS))
        if name not in recorded:
            recorded[name] = record(name, COMMANDS[name], base / name / "disk")
        command = recorded[name]
        index = rng.randrange(len(command.cuts))
        lost = rng.random() < ALL_LOST
        how = "all" if lost else "some"
        case = f"{name}: before sync {index + 1} of {len(command.cuts)}, {how} of the rest lost"
        return Trial(case, lambda: recover(command, index, folder / "disk", None if lost else rng))

    yield plan


def record(name: str, command: Command, root: Path) -> Recorded:
    """Run a command on a disk; what it has finished must be durable."""
    root.mkdir(parents=True)
    folder = root / "runs" / "one"
    prepare_quietly(lambda: command.before(folder))
    disk = Disk(root)
    with mock.patch.object(os, "fsync", disk.fsync):
        prepare_quietly(lambda: command.begin(folder))
    end = disk.cut()
    cuts = disk.cuts[:-1]
    disk.close()
    whole = lasting(folder)
    left = end.restore(root.parent / "end") / "runs" / "one"
    check_same(left, whole)
    for path in (folder / "figures").glob("*"):
        if (left / path.relative_to(folder)).read_bytes() != path.read_bytes():
            raise Fault(f"{name}: {path.name} was not durable at the end")
    return Recorded(name, command, cuts, whole, folder)


def recover(recorded: Recorded, index: int, disk: Path, rng: Random | None) -> str:
    """Continue after a cut, or start anew if no mission had been run."""
    cut = recorded.cuts[index]
    folder = cut.restore(disk, rng) / "runs" / "one"
    if recorded.name == "sweep":
        return sweep_again(recorded, folder)
    if not (folder / "missions.csv").exists():
        if any(table.count(b"\n") > 1 for table in missions_at(cut)):
            raise Fault("missions.csv: lost, though missions had been run")
        return SAME
    answer = call(lambda: recorded.command.again(folder))
    if answer.status != DONE:
        raise Fault(f"status {answer.status}: {answer.errors}")
    check_same(folder, recorded.whole)
    check_figures(recorded.folder, folder)
    return SAME


def check_figures(whole: Path, folder: Path) -> None:
    """Require the figures of a run: a table with its bytes, and a picture that is not empty."""
    for path in (whole / "figures").glob("*"):
        now = folder / "figures" / path.name
        size = now.stat().st_size if now.exists() else 0
        if not size or (path.suffix == ".csv" and now.read_bytes() != path.read_bytes()):
            raise Fault(f"figures/{path.name}: {size} bytes, not drawn again")


def sweep_again(recorded: Recorded, folder: Path) -> str:
    """Type a sweep again, without the folders in which no mission had been run."""
    for run in folder.glob("[!.]*") if folder.exists() else ():
        if run.is_dir() and not (run / "missions.csv").exists():
            discard(run)
    answer = call(lambda: recorded.command.again(folder))
    if answer.status != DONE:
        raise Fault(f"status {answer.status}: {answer.errors}")
    for run in recorded.folder.iterdir():
        if (run / "missions.csv").exists():
            check_equal(folder / run.name, run)  # a run that starts anew has another date
    return SAME


def discard(folder: Path) -> None:
    """Delete the folder of a run that had not begun, as the documents allow."""
    for path in sorted(folder.rglob("*"), reverse=True):
        path.rmdir() if path.is_dir() else path.unlink()
    folder.rmdir()


def missions_at(cut: Cut) -> Iterator[bytes]:
    """Yield the tables of missions that had been written at a cut."""
    for names in cut.written.names.values():
        if "missions.csv" in names:
            yield cut.written.contents[names["missions.csv"]]
