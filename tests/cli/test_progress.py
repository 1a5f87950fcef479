import os
import pty
import re
import select
import subprocess
import sys
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from helpers import OPTION, TINY, resume

from evoros.base.console import DONE, INTERRUPTED
from evoros.cli.progress import Progress
from evoros.mission.outcome import Outcome

FLOWN: Any = Outcome.failure("time_limit", "", 10.0, 0)


def after(generations: int, flown: int, monkeypatch: pytest.MonkeyPatch) -> str:
    """The line when so many missions are flown, ten in each generation, a second each."""
    now = [0.0]
    monkeypatch.setattr("evoros.cli.progress.time.monotonic", lambda: now[0])
    display = Progress(live=False)
    display.start(generations)
    for number in range(flown):
        if number % 10 == 0:
            display.begin(number // 10, 8, 0)
        if number % 10 == 8:
            display.begin(number // 10, 2, 0)  # the validation
        now[0] += 1.0
        display.mission(None, FLOWN)  # type: ignore[arg-type]
        if number % 10 == 9:
            best = SimpleNamespace(fitness=1.0)
            state = SimpleNamespace(best=best, validated=None, mean=0.5, number=number // 10)
            display.generation(state)  # type: ignore[arg-type]
    return display.line()


@pytest.mark.parametrize("flown", [10, 15, 20, 28, 39])
def test_the_time_left_is_right_where_all_generations_are_alike(
    flown: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = re.search(r"0:(\d\d):(\d\d) left", after(4, flown, monkeypatch))
    assert found
    left = 60 * int(found[1]) + int(found[2])
    validation = 2 if flown % 10 in range(1, 9) else 0  # is not known of before it begins
    assert left == 40 - flown - validation


def test_nothing_is_promised_before_anything_is_known(monkeypatch: pytest.MonkeyPatch) -> None:
    assert "left" not in after(4, 0, monkeypatch)
    assert after(4, 1, monkeypatch).startswith("generation 0/3 | missions 1/8 | ")


@pytest.fixture
def terminal(tmp_path: Path) -> Iterator[tuple[int, "subprocess.Popen[bytes]"]]:
    """The command on a terminal of its own: the side of the person, and the process."""
    person, machine = pty.openpty()
    more = ["simulator.pause_s=0.1", "executor.workers=1", "hydra.run.dir=run"]
    code = "from evoros.cli.run import main; main()"
    process = subprocess.Popen(
        [sys.executable, "-c", code, *TINY, *more],
        cwd=tmp_path,
        env={**os.environ, "TERM": "xterm", "COLUMNS": "120"},
        preexec_fn=partial(os.login_tty, machine),  # so that Ctrl-C is a signal
    )
    os.close(machine)
    yield person, process
    process.kill()
    process.wait()
    os.close(person)


def shown(terminal: int, until: str) -> str:
    """What the terminal gets until a pattern is there, or until its end."""
    found = b""
    deadline = time.monotonic() + 120
    while not re.search(until.encode(), found) and time.monotonic() < deadline:
        if select.select([terminal], [], [], 1.0)[0]:
            try:
                found += os.read(terminal, 65536)
            except OSError:  # the other side is closed
                break
    return found.decode(errors="replace")


HIDE, SHOW = "\x1b[?25l", "\x1b[?25h"


def test_the_live_line_counts_and_leaves_the_terminal_as_it_was(
    terminal: tuple[int, "subprocess.Popen[bytes]"],
) -> None:
    person, process = terminal
    text = shown(person, "nothing more")
    assert process.wait(60) == DONE
    assert re.search(r"generation 2/2 \| best \d", text)
    counted = [int(found) for found in re.findall(r"generation 0/2 \| missions (\d)/8", text)]
    assert counted == sorted(counted)
    assert len(set(counted)) > 1
    assert text.index("generation 0/2 |") < text.index("generation 0/2: best")
    assert text.rindex(HIDE) < text.rindex(SHOW) < text.index("best fitness")
    after = text[text.rindex(SHOW) :]
    assert "simulated s/s |" not in after
    assert "\x1b[" not in after.removeprefix(SHOW).split("best fitness")[1]


def test_ctrl_c_on_a_terminal_says_how_to_go_on(
    terminal: tuple[int, "subprocess.Popen[bytes]"], tmp_path: Path
) -> None:
    person, process = terminal
    text = shown(person, "missions [1-7]/8")
    os.write(person, b"\x03")
    text += shown(person, "nothing more")
    assert process.wait(60) == INTERRUPTED
    assert "Traceback" not in text
    after = text[text.rindex(SHOW) :]
    assert f"evoros: interrupted; to continue type: evoros resume=run {OPTION}" in after
    assert resume(tmp_path / "run", "executor=serial", "optimizer.generations=3") == DONE
