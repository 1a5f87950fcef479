"""Calls on hostile folders: forged fields with right digests, links, devices, nesting, escapes.

No command may follow a link, run code, hang or print control characters. It ends well and changes
nothing, or it says in one line what is wrong and leaves the folder as it is.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from random import Random

from cases import READ, REFUSED, Answer, Fault, Trial, call, check_line, prepare_quietly
from forgeries import FORGERIES
from helpers import TINY, copied, resume, scored, tiny

from evoros.cli.command import evaluate
from evoros.cli.diff import diff
from evoros.cli.main import evoros
from evoros.terminal.console import DIFFERENT, DONE

LIMIT_S = 60.0
Command = Callable[[Path, Path], int]


def _analyze(name: str) -> Command:
    return lambda folder, out: evoros(["analyze", name, str(folder), "--output", str(out)])


COMMANDS: dict[str, Command] = {
    "resume": lambda folder, out: resume(folder),
    "diff": lambda folder, out: diff([str(folder), str(folder.parent / "whole")]),
    "status": lambda folder, out: evoros(["status", str(folder)]),
    "evaluate": lambda folder, out: evaluate(
        [*TINY, "executor=serial", f"designs='{folder}'", f"hydra.run.dir={out}"]
    ),
    "analyze fitness": _analyze("fitness"),
    "analyze mission": _analyze("mission"),
    "analyze compare": _analyze("compare"),
    "analyze report": _analyze("report"),
    "analyze bag": _analyze("bag"),
}


@contextmanager
def prepare(base: Path) -> Iterator[Callable[[int, Path], Trial]]:
    """Make the folders that are forged."""
    prepare_quietly(
        lambda: tiny(base / "run", "optimizer.generations=1", "record=all", "figures=[fitness]")
    )
    prepare_quietly(lambda: scored(base / "scores", base / "run", "trials=2", "record=all"))

    def plan(seed: int, folder: Path) -> Trial:
        rng = Random(f"hostile {seed}")
        subject = rng.choice(("run", "run", "scores"))
        run, outside = copied(base / subject, folder / "run"), folder / "outside"
        (folder / "whole").symlink_to(base / subject)
        outside.mkdir()
        (outside / "secret").write_text("secret\n")
        kind, command = rng.choice(list(FORGERIES)), rng.choice(list(COMMANDS))
        how = FORGERIES[kind](run, outside, rng)
        case = f"{kind}: {command} of the {subject}, {how!a}"
        return Trial(case, lambda: judge(COMMANDS[command], run, outside, base / subject))

    yield plan


def judge(command: Command, folder: Path, outside: Path, whole: Path) -> str:
    """Call a command on a hostile folder, of which ``whole`` is the original."""
    before, beyond = snapshot(folder), snapshot(outside)
    answer = call(lambda: command(folder, folder.parent / "out"))
    if snapshot(outside) != beyond:
        raise Fault("files outside have changed")
    check_secret(answer, folder.parent / "out")
    if answer.status not in (DONE, DIFFERENT):
        check_line(answer)
        if changed := list_changes(before, snapshot(folder)):
            raise Fault(f"{changed[0]}: changed by a command that refuses")
        return REFUSED
    mended = snapshot(whole)
    for name in list_changes(before, snapshot(folder)):
        now = snapshot(folder).get(name)
        renewed = name.startswith(("damaged", "digests.csv", "figures", "status.json"))
        if not renewed and now != mended.get(name):
            raise Fault(f"{name}: changed to what it never was")
    return READ


def list_changes(before: dict[str, object], now: dict[str, object]) -> list[str]:
    """List the files that have changed, apart from the log and the status, which may say why."""
    names = sorted({*before, *now} - {"evoros.log", "status.json"})
    return [name for name in names if before.get(name) != now.get(name)]


def check_secret(answer: Answer, out: Path) -> None:
    """Require that nothing has read what is outside."""
    files = [path for path in out.rglob("*") if path.is_file()] if out.exists() else []
    said = (answer.output + answer.errors).encode(errors="surrogateescape")
    words = [said, *(f.read_bytes() for f in files)]
    if any(b"secret\n" in text or b"root:x:0" in text for text in words):
        raise Fault("the content of a file outside was read")


def snapshot(folder: Path) -> dict[str, object]:
    """Return what is at each path, without following a link or reading a pipe."""
    found: dict[str, object] = {}
    for path in sorted(folder.rglob("*")):
        name = str(path.relative_to(folder))
        if path.is_symlink():
            found[name] = path.readlink()
        elif path.is_file():
            size = path.stat().st_size
            found[name] = path.read_bytes() if size < 1 << 24 else size
        elif not path.is_dir():
            found[name] = "special"
    return found
