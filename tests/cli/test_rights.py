"""Commands of a user without rights in a folder: one line, and nothing is lost.

Root may write everywhere, so that commands of root give up this privilege first: a process for
good, a thread for as long as a command takes.
"""

import ctypes
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, chdir, contextmanager, redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path

import pytest
from helpers import (
    TINY,
    USER_PARTS,
    content,
    copied,
    cut,
    everything,
    finished_run,
    resume,
    wait_for_missions,
)

from evoros.cli.main import evoros
from evoros.compilation import machine_code, rules
from evoros.compilation.named_rules import NamedRule
from evoros.compilation.rules import FILTER, CompiledRule
from evoros.filter.protocol import FILTER_ARGUMENTS
from evoros.filter.silence import Silence
from evoros.storage.creation import create_folder
from evoros.storage.layout import seal_json
from evoros.terminal.console import DONE, INPUT, STOPPED

LIMIT_S = 120.0
DROP_FROM_BOUNDING_SET = 24  # PR_CAPBSET_DROP of prctl
PASS_OVER_RIGHTS = (1, 2)  # CAP_DAC_OVERRIDE, CAP_DAC_READ_SEARCH
CAPABILITIES_OF_THREAD = (ctypes.c_uint32 * 2)(0x20080522, 0)  # version 3; this thread
GET_SECURE_BITS, SET_SECURE_BITS = 27, 28
SHORT = "optimizer.generations=1"
KEEP_EFFECTIVE = 4  # SECBIT_NO_SETUID_FIXUP: access(), too, goes by the effective capabilities


def obey_rights() -> None:
    """Let the program that this process becomes have no more rights than the bits of files say."""
    if os.geteuid() == 0:
        for capability in PASS_OVER_RIGHTS:
            ctypes.CDLL(None).prctl(DROP_FROM_BOUNDING_SET, capability, 0, 0, 0)


@contextmanager
def rights_obeyed() -> Iterator[None]:
    """Let this thread, and those that it starts, do no more than the bits of files say."""
    libc = ctypes.CDLL(None, use_errno=True)
    if os.geteuid() != 0:
        yield
        return
    known = (ctypes.c_uint32 * 6)()  # effective, permitted and inheritable, twice 32 bits
    assert libc.capget(CAPABILITIES_OF_THREAD, known) == 0
    fewer = (ctypes.c_uint32 * 6)(*known)
    fewer[0] &= ~sum(1 << capability for capability in PASS_OVER_RIGHTS)
    bits = libc.prctl(GET_SECURE_BITS, 0, 0, 0, 0)
    assert libc.prctl(SET_SECURE_BITS, bits | KEEP_EFFECTIVE, 0, 0, 0) == 0
    assert libc.capset(CAPABILITIES_OF_THREAD, fewer) == 0
    try:
        yield
    finally:
        assert libc.capset(CAPABILITIES_OF_THREAD, known) == 0
        assert libc.prctl(SET_SECURE_BITS, bits, 0, 0, 0) == 0


def obedient(
    code: str, arguments: list[str], cwd: Path, **environment: str
) -> "subprocess.Popen[str]":
    return subprocess.Popen(
        [sys.executable, "-c", code, *arguments],
        cwd=cwd,
        env={**os.environ, "PYTHONUNBUFFERED": "1", **environment},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=obey_rights,
    )


def command(*arguments: str, cwd: Path) -> tuple[int, str, list[str]]:
    """The exit status of a command in this process, its output and its messages."""
    output, errors = StringIO(), StringIO()
    with chdir(cwd), redirect_stdout(output), redirect_stderr(errors), rights_obeyed():
        status = evoros(arguments)
    return status, output.getvalue(), errors.getvalue().splitlines()


@contextmanager
def closed(folder: Path, bits: int = 0o222) -> Iterator[Path]:
    """Take these rights away from a folder and all that is in it."""
    paths = [folder, *folder.rglob("*")]
    modes = {path: path.stat().st_mode for path in paths}
    for path in reversed(paths):
        path.chmod(modes[path] & ~bits)
    try:
        yield folder
    finally:
        for path in paths:
            path.chmod(modes[path])


@pytest.fixture(scope="module", autouse=True)
def _rights_are_obeyed(tmp_path_factory: pytest.TempPathFactory) -> None:
    with closed(tmp_path_factory.mktemp("probe")) as folder:
        probe = obedient("open('file', 'w')", [], folder)
        _, errors = probe.communicate(timeout=LIMIT_S)
        if probe.returncode == 0:
            pytest.skip("this user may write everywhere, and cannot give that up")
        assert "PermissionError" in errors
        with rights_obeyed(), pytest.raises(PermissionError):
            (folder / "file").touch()


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return finished_run(tmp_path_factory.mktemp("whole") / "run", SHORT)


@pytest.mark.parametrize(
    "more",
    [
        ["hydra.run.dir=closed/new"],
        ["-m", "seed=0", "hydra.sweep.dir=closed/new"],
        ["evaluate", "designs={whole}", "hydra.run.dir=closed/new"],
    ],
)
def test_a_folder_that_cannot_be_made_is_told_in_one_line(
    more: list[str], whole: Path, tmp_path: Path
) -> None:
    (tmp_path / "closed").mkdir()
    with closed(tmp_path / "closed") as folder:
        words = [*TINY, "executor=serial", *(text.format(whole=whole) for text in more)]
        arguments = sorted(words, key=lambda word: word not in ("evaluate", "-m"))  # these first
        status, _, errors = command(*arguments, cwd=tmp_path)
        assert status == INPUT
        (line,) = errors
        assert "closed/new" in line
        assert "cannot be created (Permission denied); choose another with hydra.run.dir" in line
        assert not any(folder.iterdir())


def test_a_begun_run_that_can_be_read_only_is_left_as_it_is(whole: Path, tmp_path: Path) -> None:
    run = copied(whole, tmp_path / "run")
    cut(run, (run / "missions.csv").stat().st_size // 2)
    (run / "status.json").write_text(seal_json("status.json", {"state": "running"}))
    before = everything(run)
    with closed(run):
        arguments = ["resume", "run", "--config-dir", str(USER_PARTS)]
        status, _, errors = command(*arguments, cwd=tmp_path)
        assert status == INPUT
        (line,) = errors
        assert "run: must be writable by this user" in line
        assert "give this user read and write permission, or copy the folder" in line
    assert everything(run) == before
    assert resume(run, "executor=serial") == DONE
    assert content(run) == content(whole)


@pytest.mark.slow
def test_rights_that_go_in_mid_run_stop_it_in_one_line_and_it_goes_on_with_them(
    whole: Path, tmp_path: Path
) -> None:
    arguments = [*TINY, SHORT, "executor=serial", "simulator.pause_s=0.3", "hydra.run.dir=run"]
    code = "from evoros.cli.main import main; main()"
    process = obedient(code, arguments, tmp_path)
    wait_for_missions(tmp_path / "run", 3)
    with closed(tmp_path / "run"):
        _, errors = process.communicate(timeout=LIMIT_S)
        assert process.returncode == STOPPED
        last = errors.splitlines()[-1]
        assert (
            "cannot be used (Permission denied); give this user read and write permission" in last
        )
        assert "to continue, type: evoros resume run" in last
        assert "Traceback" not in errors
    assert resume(tmp_path / "run", "executor=serial") == DONE
    assert content(tmp_path / "run") == content(whole)


@pytest.mark.slow
def test_a_run_that_can_be_read_only_is_evaluated_compared_and_shown(
    whole: Path, tmp_path: Path
) -> None:
    before = everything(whole)
    with closed(whole):
        arguments = [*TINY, "executor=serial", f"designs={whole}", "hydra.run.dir=scores"]
        status, _, errors = command("evaluate", *arguments, cwd=tmp_path)
        assert status == DONE, errors
        status, output, errors = command("diff", str(whole), str(whole), cwd=tmp_path)
        assert (status, errors) == (DONE, [])
        assert output.startswith("equal")
        status, output, errors = command("status", str(whole), cwd=tmp_path)
        assert (status, errors) == (DONE, [])
        assert "finished" in output
        arguments = ["fitness", str(whole)]
        status, _, errors = command("analyze", *arguments, cwd=tmp_path)
        assert status == INPUT
        (line,) = errors
        assert f"--output {whole}/figures: cannot be written (Permission denied)" in line
    assert everything(whole) == before


@pytest.mark.parametrize(
    "arguments",
    [
        ["resume", "{run}", "--config-dir", str(USER_PARTS)],
        ["evaluate", *TINY, "designs={run}", "hydra.run.dir=scores"],
        ["status", "{run}"],
        ["diff", "{run}", "{run}"],
        ["analyze", "fitness", "{run}"],
    ],
)
def test_a_folder_that_cannot_be_read_is_told_without_a_traceback(
    arguments: list[str], whole: Path, tmp_path: Path
) -> None:
    run = copied(whole, tmp_path / "run")  # a process warns once of a path
    with closed(run, 0o777):
        words = [word.format(run=run) for word in arguments]
        found, _, errors = command(*words, cwd=tmp_path)
    assert found == INPUT
    assert str(run) in errors[0]
    assert "(Permission denied); give this user read and write permission" in errors[0]
    assert not any("Traceback" in line for line in errors)


def test_a_folder_that_cannot_be_read_costs_a_study_nothing_else(
    whole: Path, tmp_path: Path
) -> None:
    for name in ("good", "bad"):
        subprocess.run(["cp", "-r", str(whole), str(tmp_path / name)], check=True)
    for place in (tmp_path / "bad", tmp_path / "bad" / "manifest.json"):
        with closed(place, 0o777):
            arguments = ["fitness", "good", "bad", "--output", str(tmp_path / "out")]
            status, _, errors = command("analyze", *arguments, cwd=tmp_path)
        assert status == DONE, errors
        assert any("bad" in line and line.endswith("left out") for line in errors)
        assert not any("Traceback" in line for line in errors)
        assert all("good" not in line for line in errors if "left out" in line)


@pytest.mark.parametrize("mask", [0o077, 0o027, 0o002])
def test_a_run_folder_has_the_rights_that_the_umask_leaves(mask: int, tmp_path: Path) -> None:
    before = os.umask(mask)
    try:
        create_folder(tmp_path / "outputs" / "run", {"config.yaml": "a: 1", "missions.csv": "a"})
    finally:
        os.umask(before)
    for path in (tmp_path / "outputs").rglob("*"):
        assert path.stat().st_mode & 0o777 == (0o777 if path.is_dir() else 0o666) & ~mask


def test_a_cache_that_cannot_be_written_costs_time_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """Rules are compiled in each process that needs them."""
    folders = [tmp_path / name for name in ("cache", "temporary")]
    for folder in folders:
        folder.mkdir()
    monkeypatch.setenv("XDG_CACHE_HOME", str(folders[0]))
    monkeypatch.setattr("tempfile.tempdir", str(folders[1]))
    monkeypatch.setattr(machine_code, "cache_folder", machine_code.cache_folder.__wrapped__)
    for closed_folders in ([folders[0]], folders):
        with ExitStack() as stack:
            for folder in closed_folders:
                stack.enter_context(closed(folder))
            stack.enter_context(rights_obeyed())
            caplog.clear()
            rule = NamedRule(Silence.rule, FILTER_ARGUMENTS, Silence.Parameters)
            assert isinstance(rules._compile.__wrapped__(rule, FILTER), CompiledRule)
        warned = ["every process compiles the rules again" in text for text in caplog.messages]
        assert warned == ([True] if closed_folders == folders else [])
        assert not any(folders[0].iterdir())
    # The folder for temporary files served until it was closed, too.
    assert any(folders[1].rglob("*.nbc"))
