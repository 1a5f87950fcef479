"""The command: what it refuses, and how it ends."""

import signal
import socket
from pathlib import Path
from urllib.error import URLError
from urllib.request import urlopen

import pytest
from executor_calls import list_group, wait_until
from helpers import finished_run, refused, start

from evoros.cli.main import evoros
from evoros.terminal.console import STOPPED


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["watch"], "required: FOLDER"),
        (["watch", "FILE"], "a file, not a folder"),
        (["watch", "FULL"], "contains files, but no run, evaluation or sweep"),
        (["watch", "new", "--prot=1"], "unexpected argument --prot=1"),
        (
            ["watch", "new", "--once"],
            "--once: belongs to evoros status, not to evoros watch, which has",
        ),
        (["watch", "new", "--port=x"], "--port: invalid int value: 'x'"),
        (
            ["watch", "new", "--port=70000"],
            "--port: must be from 0 (any free port) to 65535, not 70000",
        ),
        (["watch", "new", "--port=PORT"], "Address already in use"),
    ],
)
def test_what_cannot_be_watched_is_refused_in_one_line(
    arguments: list[str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").touch()
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "photo.png").touch()
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        places = {"FILE": str(tmp_path / "file"), "FULL": str(tmp_path / "full"), "PORT": port}
        typed = [word.replace("PORT", port) for word in (places.get(w, w) for w in arguments)]
        assert words in refused(lambda: evoros(typed), capsys)


@pytest.mark.slow
def test_a_signal_ends_it_and_leaves_nothing(tmp_path: Path) -> None:
    """Ctrl-C does in test_page.py."""
    run = finished_run(tmp_path / "run")
    names = sorted(run.rglob("*"))
    process = start(["watch", str(run)], tmp_path)
    assert process.stdout is not None
    address, hint = (process.stdout.readline().strip() for _ in range(2))
    assert "Ctrl-C" in hint
    with urlopen(address, timeout=60) as page:
        assert b"finished" in page.read()
    process.send_signal(signal.SIGTERM)
    _, error = process.communicate(timeout=60)
    assert process.returncode == STOPPED
    assert error.splitlines()[-1] == "evoros watch: terminated by a signal"
    assert "Traceback" not in error
    assert wait_until(lambda: not list_group(process.pid))
    with pytest.raises(URLError):
        urlopen(address, timeout=60)
    assert sorted(run.rglob("*")) == names
