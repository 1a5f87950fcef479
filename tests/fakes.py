"""What the tests of runs share: a fast run by a user's own simulator, here or in a process."""

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from evoros.cli import evoros

OWN = Path(__file__).parent / "own"
TINY = ("--config-dir", str(OWN), "experiment=tiny")


def tiny(folder: Path, *more: str) -> int:
    """A run of seconds in this process; returns the exit status."""
    return evoros([*TINY, "executor=serial", f"hydra.run.dir={folder}", *more])


def resume(folder: Path, *more: str) -> int:
    return evoros(["--config-dir", str(OWN), f"resume={folder}", *more])


def start(
    arguments: Sequence[str], cwd: Path, entry: str = "evoros.cli"
) -> "subprocess.Popen[str]":
    """The command in a process of its own, which leads a process group."""
    return subprocess.Popen(
        [sys.executable, "-c", f"from {entry} import main; main()", *arguments],
        cwd=cwd,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def content(folder: Path) -> dict[str, str]:
    """What must be the same for any number of workers and any interruption."""
    missions = (folder / "missions.csv").read_text().splitlines()
    files = [*(folder / "generations").iterdir(), *(folder / "champion").iterdir()]
    tables = {str(file.relative_to(folder)): file.read_text() for file in sorted(files)}
    return {"missions.csv": "\n".join(sorted(missions)), **tables}


def everything(folder: Path) -> dict[str, bytes]:
    """All files below a folder."""
    return {str(f.relative_to(folder)): f.read_bytes() for f in folder.rglob("*") if f.is_file()}
