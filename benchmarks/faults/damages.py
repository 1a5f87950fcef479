"""Damages: a file of a folder is changed, cut, lost or swapped, without a new digest.

Analysis has to notice it in one line or read the same content, and the command that is typed again
has to end with the same bytes or to refuse in one line and leave the rest as it is.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from random import Random
from typing import NamedTuple

from cases import (
    REFUSED,
    SAME,
    Answer,
    Fault,
    Trial,
    call,
    check_refusal,
    check_same,
    lasting,
    prepare_quietly,
)
from helpers import copied, cut, everything, resume, scored, sweep, tiny

from evoros.analysis.tables.records import EvaluationRecord, read_record
from evoros.base.errors import InputError
from evoros.storage.figure_context import FigureContext
from evoros.terminal.console import DONE

LIMIT_S = 60.0
UNUSED = ("evoros.log", "figures", "damaged")
"""Files on which nothing depends."""


class Subject(NamedTuple):
    """A folder to be damaged, how it has to end, and the command that is typed again."""

    folder: Path
    end: Path
    again: Callable[[Path], int]
    killed: bool = False


Damage = Callable[[bytes, Random], bytes | None]
"""Returns the damaged content of a file; None if it is lost."""


def flip(content: bytes, rng: Random) -> bytes:
    """Flip a bit."""
    changed = bytearray(content)
    changed[rng.randrange(len(content))] ^= 1 << rng.randrange(8)
    return bytes(changed)


def blank(content: bytes, rng: Random) -> bytes:
    """Write zeros over a block, as a file system may leave it."""
    size = min(len(content), rng.choice((1, 16, 512, 4096)))
    at = rng.randrange(len(content) - size + 1)
    return content[:at] + bytes(size) + content[at + size :]


def truncate(content: bytes, rng: Random) -> bytes:
    """Cut the end off."""
    return content[: rng.randrange(len(content))]


def repeat_line(content: bytes, rng: Random) -> bytes:
    """Give a line twice."""
    lines = content.splitlines(keepends=True)
    at = rng.randrange(len(lines))
    return b"".join([*lines[: at + 1], *lines[at:]])


def drop_line(content: bytes, rng: Random) -> bytes:
    """Leave a line out."""
    lines = content.splitlines(keepends=True)
    del lines[rng.randrange(len(lines))]
    return b"".join(lines)


def swap_lines(content: bytes, rng: Random) -> bytes:
    """Swap two lines."""
    lines = content.splitlines(keepends=True)
    a, b = rng.randrange(len(lines)), rng.randrange(len(lines))
    lines[a], lines[b] = lines[b], lines[a]
    return b"".join(lines)


def change_digit(content: bytes, rng: Random) -> bytes:
    """Type another digit, as in an editor."""
    places = [at for at, byte in enumerate(content) if chr(byte).isdigit()]
    if not places:
        return flip(content, rng)
    at = rng.choice(places)
    return content[:at] + str((int(chr(content[at])) + 1) % 10).encode() + content[at + 1 :]


DAMAGES: dict[str, Damage] = {
    "a bit flips": flip,
    "a block is blank": blank,
    "the end is lost": truncate,
    "a line comes twice": repeat_line,
    "a line is lost": drop_line,
    "two lines are swapped": swap_lines,
    "a digit is another": change_digit,
    "line ends are those of Windows": lambda content, rng: content.replace(b"\n", b"\r\n"),
    "junk is inserted": lambda content, rng: _insert(content, rng.randbytes(20), rng),
    "junk follows": lambda content, rng: content + rng.randbytes(rng.randint(1, 300)),
    "it is empty": lambda content, rng: b"",
    "it is lost": lambda content, rng: None,
}


def _insert(content: bytes, junk: bytes, rng: Random) -> bytes:
    at = rng.randint(0, len(content))
    return content[:at] + junk + content[at:]


FOREIGN = "it is from another run"
SIBLING = "it is another file of the folder"


def damage(folder: Path, name: str, how: str, foreign: Path, rng: Random) -> None:
    """Damage a file; ``foreign`` is the folder of another run."""
    path = folder / name
    if how == FOREIGN:
        content: bytes | None = _find_twin(foreign, name, path).read_bytes()
    elif how == SIBLING:
        content = (folder / rng.choice(sorted(everything(folder)))).read_bytes()
    else:
        content = DAMAGES[how](path.read_bytes(), rng) if path.stat().st_size else b"\0"
    if content is None:
        path.unlink()
    else:
        path.write_bytes(content)


def _find_twin(foreign: Path, name: str, path: Path) -> Path:
    twin = foreign / Path(name).name if not (foreign / name).exists() else foreign / name
    return twin if twin.exists() else path


def kinds(folder: Path) -> dict[str, list[str]]:
    """List the files of each kind, whose names differ in numbers only."""
    names: dict[str, list[str]] = {}
    for name in sorted(everything(folder)):
        if not any(part.startswith(UNUSED) for part in Path(name).parts):
            names.setdefault("".join(c for c in name if not c.isdigit()), []).append(name)
    return names


@contextmanager
def prepare(base: Path) -> Iterator[Callable[[int, Path], Trial]]:
    """Make a run, the same run killed, an evaluation and a sweep."""
    two, keep = "optimizer.generations=2", "record=all"
    prepare_quietly(lambda: tiny(base / "run", two, keep))
    prepare_quietly(lambda: tiny(base / "other", two, keep, "seed=1"))
    copied(base / "run", base / "killed")
    cut(base / "killed", (base / "run" / "missions.csv").stat().st_size * 2 // 3)
    prepare_quietly(lambda: scored(base / "scores", base / "run", "trials=2", keep))
    prepare_quietly(lambda: sweep(base / "sweep", "seed=0,1"))
    subjects = {
        "finished run": Subject(base / "run", base / "run", resume),
        "killed run": Subject(base / "killed", base / "run", resume, killed=True),
        "evaluation": Subject(base / "scores", base / "scores", resume),
        "sweep": Subject(base / "sweep", base / "sweep", lambda f: sweep(f, "seed=0,1")),
    }

    def plan(seed: int, folder: Path) -> Trial:
        rng = Random(f"damage {seed}")
        subject = rng.choice(list(subjects))
        name = rng.choice(rng.choice(list(kinds(subjects[subject].folder).values())))
        how = rng.choice([*DAMAGES, FOREIGN, SIBLING])
        run = copied(subjects[subject].folder, folder / "run")
        damage(run, name, how, base / "other", rng)
        return Trial(f"{subject}: {name}: {how}", lambda: judge(subjects[subject], run, name))

    yield plan


def judge(subject: Subject, folder: Path, name: str) -> str:
    """Read a damaged folder, then type its command again."""
    changed = everything(folder) != everything(subject.folder)
    noticed, lost = check_analysis(subject, folder, name), not (folder / name).exists()
    before = everything(folder)
    answer = call(lambda: subject.again(folder))
    if answer.status != DONE:
        check_refusal(answer, folder, before)
        check_name(answer, name)
        return REFUSED
    words = answer.errors
    if folder.joinpath(Path(name).parts[0], "champion").exists() and "champion" in name:
        # A sweep does not read the robots, worlds and trajectories of its finished runs.
        words += call(lambda: resume(folder / Path(name).parts[0])).errors
    check_same(folder, lasting(subject.end))
    # A kill may leave what a killed run has; nothing is to be said of a file that is made again;
    # evaluations write their status again in any case.
    quiet = subject.killed or lost or Path(name).name == "status.json"
    if changed and noticed and not quiet and Path(name).name not in words:
        raise Fault(f"{name}: mended without a word")
    return SAME


def check_name(answer: Answer, name: str) -> None:
    """Require that a refusal names the file."""
    if Path(name).name not in answer.errors:
        raise Fault(f"{name}: not named in {answer.errors!r}")


def check_analysis(subject: Subject, folder: Path, name: str) -> bool:
    """Return whether analysis notices a damage; if not, it must read what it would have read."""
    place = next(part for part in ("", Path(name).parts[0]) if is_run(subject.folder / part))
    run = folder / place
    try:
        content = read_all(run)
    except InputError as error:
        line = str(error)
        if "\n" in line or (str(run) not in line and not name.startswith("trajectories")):
            raise Fault(f"{name}: analysis says {line!r}") from error
        return True
    if subject.killed and name == "missions.csv":
        return False  # rows that a kill has not let be written
    if "trajectories" in name and not name.endswith(".csv"):
        return False  # robots and worlds are read by some figures only
    if content != read_all(subject.folder / place):
        raise Fault(f"{name}: analysis reads something else without a word")
    return False


def is_run(folder: Path) -> bool:
    """Whether an undamaged folder is one of a run."""
    return (folder / "generations").is_dir() or (folder / "designs.csv").exists()


def read_all(folder: Path) -> list[object]:
    """Read all that figures read of a run or an evaluation."""
    record = read_record(folder, "run")
    run = record.run
    if isinstance(record, EvaluationRecord):
        tables = [run.missions, run.designs, record.mounts, record.genes]
    else:
        tables = [run.missions, run.generations]
        for row in run.missions.to_dict("records"):
            key = (int(row["generation"]), int(row["design"]), str(row["world"]), int(row["trial"]))
            tables.append(run.mission_trajectory(*key))
        if record.finished:
            tables += [run.champion, run.genes, *(run.trajectory(name) for name in ("near", "far"))]
    status = {key: value for key, value in run.status.items() if key != "digest"}
    context = FigureContext.read(folder)
    return [table.to_csv() for table in tables] + [context, record.values, status]
