"""Standard streams that are closed or full, logs that cannot be written, and homes of nobody."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from fixture_types import Capture, Folders
from helpers import TINY, content, everything, finished_run, resume

from evoros.analysis.command import evoros_analyze
from evoros.cli.command import evaluate
from evoros.cli.diff import diff
from evoros.cli.inspect import inspect
from evoros.cli.main import evoros
from evoros.cli.status import status
from evoros.cli.world import world
from evoros.terminal.console import DONE, INPUT

NOBODY = "~there_is_no_such_user"


@pytest.fixture(scope="module")
def run(tmp_path_factory: Folders) -> Path:
    return finished_run(tmp_path_factory.mktemp("streams") / "run", "optimizer.generations=1")


CODE = "import os; from evoros.cli.main import main; main()"
ASCII_ONLY = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
"""Closes Python's own way out of an ASCII locale."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("redirected", "executor"),
    [("<&- >&- 2>&-", "processes"), (">/dev/full", "serial"), ("2> >(exit 0)", "dask")],
)
def test_a_run_does_not_depend_on_its_standard_streams(
    redirected: str, executor: str, run: Path, tmp_path: Path
) -> None:
    """Nor does a table get what a library prints, because it has the number of a closed stream.

    What could not be written stays in a buffer, which each start of a worker flushes. Files are
    UTF-8, even in the locale of the first one.
    """
    given = [*TINY, "optimizer.generations=1", f"executor={executor}"]
    given += [] if executor == "serial" else ["executor.workers=1"]
    command = [sys.executable, "-c", CODE, *given, f"hydra.run.dir={tmp_path / 'run'}"]
    shell = ["bash", "-c", f'"$@" {redirected}', "bash", *command]
    environment = {name: os.environ[name] for name in os.environ if name != "PYTHONUNBUFFERED"}
    environment |= ASCII_ONLY if redirected.startswith("<") else {}
    process = subprocess.run(shell, env=environment, capture_output=True, text=True, timeout=300)
    assert process.returncode == DONE
    assert content(tmp_path / "run") == content(run)
    assert '"state": "finished"' in (tmp_path / "run" / "status.json").read_text()
    assert "Traceback" not in process.stderr
    full = process.stderr.count("cannot write to standard output (No space left on device)")
    assert full == (redirected == ">/dev/full")


def test_a_log_that_cannot_be_opened_is_refused(tmp_path: Path, capsys: Capture) -> None:
    finished_run(tmp_path / "run", "optimizer.generations=1")
    (tmp_path / "run" / "evoros.log").unlink()
    (tmp_path / "run" / "evoros.log").mkdir()
    before = everything(tmp_path / "run")
    assert resume(tmp_path / "run") == INPUT
    assert "evoros.log: cannot be written (Is a directory)" in capsys.readouterr().err
    assert everything(tmp_path / "run") == before


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs a full device")
def test_a_log_on_a_full_disk_stops_nothing_and_is_told_once(
    run: Path, tmp_path: Path, capfd: Capture
) -> None:
    from evoros.terminal.log import LOGGER, log_to_file, log_to_terminal

    with log_to_terminal(), log_to_file(Path("/dev/full")):
        LOGGER.info("one")
        LOGGER.info("another")
    err = capfd.readouterr().err
    assert err.count("/dev/full: cannot be written (No space left on device)") == 1
    assert "another" in err
    assert "Traceback" not in err


@pytest.mark.parametrize(
    ("command", "arguments"),
    [
        (evoros, ["resume", NOBODY]),
        (evoros, ["--config-dir", NOBODY]),
        (evaluate, [f"designs='{NOBODY}'"]),
        (evoros_analyze, ["fitness", NOBODY]),
        (diff, [NOBODY, NOBODY]),
        (inspect, ["robot", NOBODY]),
        (status, [NOBODY]),
        (world, [f"{NOBODY}/world.sdf"]),
    ],
)
def test_the_home_of_nobody_is_a_path_like_any_other(
    command: Callable[[list[str]], int], arguments: list[str], capsys: Capture
) -> None:
    assert command(arguments) == INPUT
    (line,) = capsys.readouterr().err.splitlines()
    assert NOBODY in line
