"""Helpers for tests of runs: a fast run by a user's own simulator, here or in a process."""

import json
import os
import shlex
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from functools import cache
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory, mkdtemp
from typing import Any

import pytest
import yaml
from matplotlib.figure import Figure
from matplotlib.text import Text

from evoros.cli.command import evaluate
from evoros.cli.main import evoros
from evoros.evolution.experiment import Experiment
from evoros.mission.scenario import Scenario
from evoros.preflight.scene import Subject, list_subjects
from evoros.storage.digests import (
    Entry,
    describe_file,
    describe_growing,
    read_entries,
    write_entries,
)
from evoros.storage.layout import ORIGINALS, seal_json, seal_rows
from evoros.storage.run_key import read_key
from evoros.terminal.console import DONE, INPUT

ROOT = Path(__file__).resolve().parent.parent
USER_PARTS = ROOT / "tests" / "user_parts"
OPTION = f"--config-dir {shlex.quote(str(USER_PARTS))}"
"""The option as it is to be typed: the clone may lie in a folder with a space."""
TINY = ("--config-dir", str(USER_PARTS), "experiment=tiny")


def with_parts(scenario: Scenario, **parts: Any) -> Scenario:
    """The scenario of one robot with other parts of it."""
    (member,) = scenario.members
    return replace(scenario, members=(replace(member, **parts),))


def alone(experiment: Experiment) -> Subject:
    """The only robot of an experiment, as preflight examines it."""
    (subject,) = list_subjects(experiment)
    return subject


def tiny(folder: Path, *more: str) -> int:
    """A run of seconds in this process; returns the exit status."""
    return evoros([*TINY, "executor=serial", f"hydra.run.dir={folder}", *more])


def finished_run(folder: Path, *more: str) -> Path:
    """Copy a finished tiny run, which is made once for its arguments in each process of tests.

    Its messages are those of the first call only; no argument may name a test's own folder.
    """
    return copied(_finish(more), folder)


_RUNS = TemporaryDirectory()


@cache
def _finish(more: tuple[str, ...]) -> Path:
    run = Path(mkdtemp(dir=_RUNS.name)) / "run"
    assert tiny(run, *more) == DONE
    return run


def refusal(folder: Path, capsys: pytest.CaptureFixture[str], *more: str) -> str:
    """The one line with which a tiny run is refused before anything is written."""
    error = refused(lambda: tiny(folder / "run", *more), capsys)
    assert not (folder / "run").exists()
    return error


def refused(call: Callable[[], int], capsys: pytest.CaptureFixture[str]) -> str:
    """The one line with which a command refuses its input."""
    assert call() == INPUT
    error = capsys.readouterr().err
    assert error.count("\n") == 1, error
    return error


def resume(folder: Path, *more: str) -> int:
    return evoros(["resume", str(folder), "--config-dir", str(USER_PARTS), *more])


def sweep(folder: Path, *more: str) -> int:
    """A sweep of two generations in this process."""
    options = ("executor=serial", "optimizer.generations=2", f"hydra.sweep.dir={folder}")
    return evoros(["-m", *TINY, *options, *more])


def start(
    arguments: Sequence[str], cwd: Path, entry: str = "evoros.cli.main"
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
    """The files that are equal for any number of workers and any interruption.

    Missions are without their digests, so that runs are comparable whose configurations differ in
    what changes no outcome, such as the pauses of a simulator.
    """
    files = [*(folder / "generations").iterdir(), *(folder / "champion").iterdir()]
    rows = (folder / "missions.csv").read_text().splitlines(keepends=True)
    missions = "".join(row.rpartition(",")[0] + "\n" for row in rows)
    others = {str(file.relative_to(folder)): file.read_text() for file in sorted(files)}
    return {"missions.csv": missions, **others}


def everything(folder: Path) -> dict[str, bytes]:
    """All files below a folder."""
    return {str(f.relative_to(folder)): f.read_bytes() for f in folder.rglob("*") if f.is_file()}


def copied(run: Path, to: Path) -> Path:
    return Path(shutil.copytree(run, to, symlinks=True))


def cut(run: Path, size: int) -> None:
    """Cut a run as a kill does when so many bytes of the missions are on disk."""
    rows = (run / "missions.csv").read_bytes()[:size]
    (run / "missions.csv").write_bytes(rows)
    done = {int(row.split(b",")[0]) for row in rows.splitlines()[1:]}
    for table in (run / "generations").iterdir():
        if int(table.stem) >= max(done, default=0):
            table.unlink()
    for file in (run / "champion").iterdir():
        file.unlink()
    (run / "champion").rmdir()
    status = json.loads((run / "status.json").read_text())
    del status["digest"]
    status |= {"state": "running", "generations_done": len([*(run / "generations").iterdir()])}
    # A status that is not recent reads as killed; this one is recent for an hour.
    later = datetime.now(UTC) + timedelta(hours=1)
    status["updated"] = later.isoformat(timespec="seconds")
    (run / "status.json").write_text(seal_json("status.json", status))
    renew_digests(run, missions=describe_growing(rows[: rows.index(b"\n") + 1]))


def wait_for_missions(run: Path, count: int) -> None:
    """Until so many are on disk."""
    deadline = time.monotonic() + 120  # the first mission may have to be compiled
    while time.monotonic() < deadline:
        table = run / "missions.csv"
        if table.exists() and table.read_text().count("\n") > count:
            return
        time.sleep(0.02)
    raise AssertionError("the run does not get going")


def reseal(folder: Path) -> Path:
    """Compute all digests anew, as if evoros itself had written what a test has edited."""
    key = b""
    for path in (folder / "manifest.json", folder / "status.json"):
        with suppress(
            OSError, ValueError, AttributeError, TypeError
        ):  # not there, or no JSON object
            content = json.loads(path.read_text())
            content.pop("digest", None)
            if isinstance(hashes := content.get("sha256"), dict):
                key = read_key(content)
                names = {"configuration" if n == "config.yaml" else n: n for n in ORIGINALS}
                for label in names.keys() & hashes.keys():
                    hashes[label] = sha256((folder / names[label]).read_bytes()).hexdigest()
            path.write_text(seal_json(path.name, content))
    header, *rows = (folder / "missions.csv").read_text().splitlines()
    sealed = seal_rows("".join(row.rpartition(",")[0] + "\n" for row in rows), key)
    (folder / "missions.csv").write_bytes(f"{header}\n".encode() + sealed)
    renew_digests(folder)
    return folder


def vary(run: Path, to: Path, config: dict[str, Any], status: dict[str, Any] | None = None) -> Path:
    """Copy a run as if it had other values, by dotted key, and another status."""
    shutil.copytree(run, to)
    tree = yaml.safe_load((to / "config.yaml").read_text())
    for key, value in config.items():
        *parents, last = key.split(".")
        node = tree
        for parent in parents:
            node = node[parent]
        node[last] = value
    (to / "config.yaml").write_text(yaml.safe_dump(tree, sort_keys=False))
    manifest = json.loads((to / "manifest.json").read_text())
    manifest["choices"] = {
        group: choice
        for group, choice in manifest["choices"].items()
        if not any(key.startswith(f"{group.rpartition('@')[2]}.") for key in config)
    }
    (to / "manifest.json").write_text(json.dumps(manifest))
    recorded = json.loads((to / "status.json").read_text())
    (to / "status.json").write_text(json.dumps({**recorded, **(status or {})}))
    return reseal(to)


def renew_digests(folder: Path, **changes: Entry) -> None:
    """Write the digests of the files that have some and are there."""
    digests = folder / "digests.csv"
    known = read_entries(digests.read_bytes()).by_name if digests.is_file() else {}
    present = {name: folder / name for name in known if (folder / name).is_file()}
    entries = {
        name: changes.get(path.stem)
        or describe_file(path.read_bytes(), not name.startswith("trajectories/"))
        for name, path in present.items()
    }
    digests.write_text(write_entries(entries))


def scored(folder: Path, designs: object, *more: str) -> Path:
    chosen = [f"designs={designs}", f"hydra.run.dir={folder}"]
    assert evaluate([*TINY, "executor=serial", *chosen, *more]) == DONE
    return folder


def texts(figure: Figure) -> list[Text]:
    """All that is drawn: no labels of ticks beyond the ends of an axis."""
    beyond = {
        id(label)
        for axes in figure.axes
        for axis in (axes.xaxis, axes.yaxis)
        for tick in axis.get_major_ticks()
        for label in (tick.label1, tick.label2)
        if not min(axis.get_view_interval()) <= tick.get_loc() <= max(axis.get_view_interval())
    }
    every = (text for text in figure.findobj(Text) if isinstance(text, Text))
    return [text for text in every if text.get_text() and id(text) not in beyond]
