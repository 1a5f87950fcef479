import os
import pty
import re
import select
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from fixture_types import Capture, Patch
from helpers import OPTION, TINY, USER_PARTS, resume, tiny
from hypothesis import given
from hypothesis import strategies as st

import evoros
from evoros.mission.mission import Outcome
from evoros.session.progress import Progress, SweepProgress
from evoros.session.screen import SEPARATOR, Line, Notebook, Pipe, Screen, Surface, fit, open_screen
from evoros.terminal.activity import announce
from evoros.terminal.console import DONE, INTERRUPTED

FLOWN: Any = (Outcome.failure("time_limit", "", 10.0, 0),)


def after(generations: int, flown: int, monkeypatch: Patch) -> str:
    """The line when so many missions are flown, ten in each generation, a second each."""
    now = [0.0]
    monkeypatch.setattr("evoros.session.progress.time.monotonic", lambda: now[0])
    display = Progress(shown=False)
    display.start(generations)
    for index in range(flown):
        if index % 10 == 0:
            display.begin(index // 10, 8, 0)
        if index % 10 == 8:
            display.begin(index // 10, 2, 0)  # the validation
        now[0] += 1.0
        display.mission(None, FLOWN)  # type: ignore[arg-type]
        if index % 10 == 9:
            best = SimpleNamespace(fitness=1.0)
            state = SimpleNamespace(best=best, validated=None, mean=0.5, number=index // 10)
            display.generation(state)  # type: ignore[arg-type]
    return display.line(79)


@pytest.mark.parametrize("flown", [10, 15, 20, 28, 39])
def test_the_time_left_is_right_where_all_generations_are_alike(
    flown: int, monkeypatch: Patch
) -> None:
    match = re.search(r"0:(\d\d):(\d\d) left", after(4, flown, monkeypatch))
    assert match
    left = 60 * int(match[1]) + int(match[2])
    validation = 2 if flown % 10 in range(1, 9) else 0  # is not known of before it begins
    assert left == 40 - flown - validation


def test_nothing_is_promised_before_anything_is_known(monkeypatch: Patch) -> None:
    assert "left" not in after(4, 0, monkeypatch)
    assert after(4, 1, monkeypatch).startswith("generation 0/3 | missions 1/8 | ")


@pytest.fixture(params=["executor.workers=1"])
def terminal(
    request: pytest.FixtureRequest, tmp_path: Path
) -> Iterator[tuple[int, "subprocess.Popen[bytes]"]]:
    """The command on a terminal of its own: the side of the person, and the process."""
    person, machine = pty.openpty()
    more = ["simulator.pause_s=0.1", request.param, "hydra.run.dir=run"]
    code = "from evoros.cli.main import main; main()"
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
    output = b""
    deadline = time.monotonic() + 120
    while not re.search(until.encode(), output) and time.monotonic() < deadline:
        if select.select([terminal], [], [], 1.0)[0]:
            try:
                output += os.read(terminal, 65536)
            except OSError:  # the other side is closed
                break
    return output.decode(errors="replace")


HIDE, SHOW = "\x1b[?25l", "\x1b[?25h"


@pytest.mark.slow
@pytest.mark.parametrize("terminal", ["executor=serial"], indirect=True)
def test_the_live_line_counts_and_leaves_the_terminal_as_it_was(
    terminal: tuple[int, "subprocess.Popen[bytes]"],
) -> None:
    person, process = terminal
    text = shown(person, "nothing more")
    assert process.wait(60) == DONE
    assert re.search(r"generation 2/2 \| best \d", text)
    counted = [int(count) for count in re.findall(r"generation 0/2 \| missions (\d)/8", text)]
    assert counted == sorted(counted)
    assert len(set(counted)) > 1
    assert text.index("generation 0/2 |") < text.index("generation 0/2: best")
    assert text.rindex(HIDE) < text.rindex(SHOW) < text.index("champion  ")
    after = text[text.rindex(SHOW) :]
    assert "simulated s/s |" not in after
    assert "\x1b[" not in after.removeprefix(SHOW).split("champion  ")[1]


@pytest.mark.slow
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
    assert f"evoros: interrupted; to continue, type: evoros resume run {OPTION}" in after
    assert resume(tmp_path / "run", "executor=serial", "optimizer.generations=3") == DONE


# ---- lines


PARTS = st.lists(st.tuples(st.integers(0, 5), st.text("abc", max_size=30)), max_size=8)


@given(parts=PARTS, width=st.integers(1, 100))
def test_a_line_fits_and_loses_what_matters_least(parts: list[tuple[int, str]], width: int) -> None:
    line = fit(parts, width)
    assert len(line) <= width
    texts = [part for part in parts if part[1]]
    if not line.endswith("…") and line:
        shown = line.split(SEPARATOR)
        kept = iter(texts)
        assert all(any(text == part[1] for part in kept) for text in shown)  # in their order
        ranks = sorted(rank for rank, _ in texts)
        whole = [text for rank, text in texts if rank < ranks[len(shown) - 1]]
        assert not Counter(whole) - Counter(shown)
    longest = SEPARATOR.join(text for _, text in texts)
    assert (line == longest) or len(longest) > width


@given(
    numbers=st.lists(st.integers(1, 10**6), min_size=6, max_size=6),
    best=st.floats(-1e6, 1e6),
    activity=st.sampled_from(["", "compiling", "choosing the champion"]),
    width=st.integers(20, 120),
)
def test_no_line_of_progress_is_wider_than_its_place(
    numbers: list[int], best: float, activity: str, width: int
) -> None:
    generations, generation, missions, known, jobs, skipped = numbers
    sweep = SweepProgress(jobs, shown=False)
    for _ in range(skipped % 5):
        sweep.skip()
    with sweep.job() as run, announce(activity):
        run.start(generations)
        run.begin(generation, missions, known)
        run.mission(None, FLOWN)  # type: ignore[arg-type]
        state = SimpleNamespace(best=SimpleNamespace(fitness=best), mean=best / 2)
        run.generation(state)  # type: ignore[arg-type]
        for line in (run.line(width), sweep.line(width)):
            assert len(line) <= width
            assert "\n" not in line
        assert run.line(200).startswith(activity)
        assert activity in sweep.line(200)


# ---- where lines are shown


@dataclass
class Wall(Surface):
    """A surface that notes when it is written on."""

    first_s: float = 0.0
    period_s: float = 0.0
    times: list[float] = field(default_factory=list)
    written: threading.Event = field(default_factory=threading.Event)
    is_open: bool = False

    def open(self) -> None:
        assert not self.is_open
        self.is_open = True

    def show(self, line: Line) -> None:
        assert self.is_open
        assert line(80) == "a line"
        self.times.append(time.monotonic())
        if len(self.times) >= 3:
            self.written.set()

    def close(self, line: Line) -> None:
        self.is_open = False


def test_lines_are_never_closer_than_their_period_also_after_pauses() -> None:
    """Time that the machine takes for others only adds to the distance."""
    wall = Wall(first_s=0.05, period_s=0.05)
    before = time.monotonic()
    screen = Screen(lambda width: "a line", wall)
    while not wall.written.is_set():
        screen.start()
        screen.start()  # has no effect
        wall.written.wait(0.01)
        screen.stop()
        assert not wall.is_open
    distances = [later - sooner for sooner, later in pairwise([before, *wall.times])]
    assert min(distances) >= 0.05


def test_work_that_ends_at_once_shows_nothing() -> None:
    wall = Wall(first_s=1000.0)
    screen = Screen(lambda width: "a line", wall)
    for _ in range(3):
        screen.start()
        screen.stop()
    assert not wall.times
    assert not wall.is_open


def test_a_pipe_gets_whole_lines_and_no_line_for_each_generation(
    tmp_path: Path, monkeypatch: Patch, capsys: Capture
) -> None:
    monkeypatch.setattr(Pipe, "first_s", 0.0)
    monkeypatch.setattr(Pipe, "period_s", 0.01)
    assert tiny(tmp_path / "run", "simulator.pause_s=0.05") == DONE
    err = capsys.readouterr().err
    assert "generation 0/2: best" not in err
    assert "generation 0/2: best" in (tmp_path / "run" / "evoros.log").read_text()
    lines = [line for line in err.splitlines() if SEPARATOR in line]
    assert any(line.startswith("generation 2/2 | best ") for line in lines)
    assert any(line.startswith("validating | ") for line in lines)
    assert max(map(len, lines)) < 80
    assert "\x1b" not in err


def test_a_pipe_whose_reader_has_gone_stops_nothing(monkeypatch: Patch) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    with open(writer, "w") as gone:  # closing it would raise if it still wrote there
        monkeypatch.setattr("sys.stderr", gone)
        Pipe().show(lambda width: "a line")
        gone.flush()


def test_a_notebook_has_one_line_that_changes(monkeypatch: Patch) -> None:
    """The calls are those that the library documents; a real notebook is tried elsewhere."""
    cells: list[list[str]] = []

    class Handle:
        def update(self, data: dict[str, str], raw: bool) -> None:
            assert raw
            cells[-1].append(data["text/plain"])

    def display(data: dict[str, str], raw: bool, display_id: bool) -> Handle:
        assert raw
        assert display_id
        cells.append([])
        return Handle()

    notebook = SimpleNamespace(
        get_ipython=lambda: SimpleNamespace(kernel=object()),
        display=SimpleNamespace(display=display),
    )
    monkeypatch.setitem(sys.modules, "IPython", notebook)
    monkeypatch.setattr(Notebook, "first_s", 0.0)
    shown = threading.Event()
    screen = open_screen(lambda width: shown.set() or "a line")  # type: ignore[func-returns-value]
    screen.start()
    assert shown.wait(60)
    screen.stop()
    assert set(cells.pop()) == {"a line"}
    assert not cells


@pytest.mark.slow
def test_evaluations_in_a_script_are_not_silent(monkeypatch: Patch, capsys: Capture) -> None:
    monkeypatch.setattr(Pipe, "first_s", 0.0)
    monkeypatch.setattr(Pipe, "period_s", 0.01)
    slow = ["experiment=tiny", "executor=serial", "simulator.pause_s=0.05"]
    config = evoros.compose(slow, config_dir=USER_PARTS)
    with evoros.Evaluator(config) as evaluator:
        design = evaluator.space.decode(np.full(evaluator.space.size, 0.5))
        evaluator.score([design, design])
    assert re.search(r"missions [1-4]/4", capsys.readouterr().err)
    with evoros.Evaluator(config, display=evoros.NoDisplay()) as evaluator:
        evaluator.score([design])
    assert capsys.readouterr().err == ""
