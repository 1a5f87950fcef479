"""A progress line, updated in place on a terminal or in a notebook, or repeated in a pipe."""

import logging
import shutil
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from operator import itemgetter
from threading import Event, Thread
from typing import TYPE_CHECKING, Any, TypeAlias

from evoros.terminal.log import LOGGER, attach, detach, format_for_terminal, silence

if TYPE_CHECKING:
    from rich.console import Console

Line: TypeAlias = Callable[[int], str]  # returns a line of at most this number of characters

SEPARATOR = " | "
NOTEBOOK_WIDTH = 100


def fit(parts: Sequence[tuple[int, str]], width: int) -> str:
    """Join nonempty (rank, string) parts; drop the highest ranks until the line fits ``width``."""
    kept = [part for part in parts if part[1]]
    while len(line := SEPARATOR.join(text for _, text in kept)) > width and len(kept) > 1:
        kept.remove(max(kept, key=itemgetter(0)))
    return line if len(line) <= width else line[: width - 1] + "…"


class Surface:
    """An output that shows a changing line."""

    first_s = 0.5  # delay [s] before the line first appears; shorter work shows no line
    period_s = 0.5  # interval between updates

    def open(self) -> None:
        """Prepare the output for the line."""

    def show(self, line: Line) -> None:
        """Show the current line."""
        raise NotImplementedError

    def close(self, line: Line) -> None:
        """Show the final line, and release the output."""


@dataclass
class Screen:
    """Shows a line on a surface from ``start`` to ``stop``; restartable."""

    line: Line
    surface: Surface
    _due: float = field(init=False)  # time.monotonic() [s] of the next update
    _stopped: Event = field(init=False, default_factory=Event)
    _thread: Thread | None = None

    def __post_init__(self) -> None:
        self._due = time.monotonic() + self.surface.first_s

    def start(self) -> None:
        """Start showing the line, unless it is already shown."""
        if self._thread is None:
            self._stopped.clear()
            self._thread = Thread(target=self._repeat, name="progress", daemon=True)
            self._thread.start()

    def stop(self) -> None:
        """Stop showing the line."""
        if self._thread is not None:
            self._stopped.set()
            if self._thread.is_alive():  # Ctrl-C may interrupt ``start`` before the thread starts
                self._thread.join()
            self._thread = None

    def _repeat(self) -> None:
        if not self._is_due():
            return
        self.surface.open()
        try:
            self._show()
            while self._is_due():
                self._show()
        finally:
            self.surface.close(self.line)

    def _is_due(self) -> bool:
        # also waits until the next update is due
        while (left := self._due - time.monotonic()) > 0:
            if self._stopped.wait(left):
                return False
        return not self._stopped.is_set()

    def _show(self) -> None:
        self.surface.show(self.line)
        self._due = time.monotonic() + self.surface.period_s


def open_screen(line: Line) -> Screen:
    """Return a screen for the notebook, terminal or pipe to which this program writes."""
    if _kernel_display() is not None:
        return Screen(line, Notebook())
    from rich.console import Console

    console = Console(stderr=True)
    if console.is_terminal and not console.is_dumb_terminal:
        return Screen(line, Terminal(console))
    return Screen(line, Pipe())


def _kernel_display() -> Callable[..., Any] | None:
    """Return the function that displays output below a notebook cell; None outside a notebook."""
    ipython = sys.modules.get("IPython")  # IPython is already imported in a notebook
    shell = None if ipython is None else ipython.get_ipython()
    if ipython is None or getattr(shell, "kernel", None) is None:
        return None
    show: Callable[..., Any] = ipython.display.display
    return show


class Terminal(Surface):
    """The last line of a terminal; messages and results scroll above it."""

    period_s = 0.25

    def __init__(self, console: "Console") -> None:
        self._console = console
        self._handler = format_for_terminal(_ConsoleHandler(console))
        self._stack = ExitStack()

    def open(self) -> None:
        """Start the line, and print standard error above it."""
        from rich.live import Live

        self._live = Live(
            console=self._console,
            auto_refresh=False,
            transient=True,
            redirect_stdout=sys.stdout.isatty(),  # redirected output does not reach this terminal
        )
        for handler in LOGGER.handlers:
            if isinstance(handler, logging.StreamHandler) and handler.stream is sys.stderr:
                self._stack.enter_context(detach(handler))
        self._stack.enter_context(attach(self._handler))
        self._live.start()

    def show(self, line: Line) -> None:
        """Replace the line; leave the last column free so that terminals do not wrap it."""
        from rich.text import Text

        text = line(self._console.width - 1)
        self._live.update(Text(text, no_wrap=True, overflow="ellipsis"), refresh=True)

    def close(self, line: Line) -> None:
        """Remove the line."""
        self._live.stop()
        self._stack.close()


class _ConsoleHandler(logging.Handler):
    def __init__(self, console: "Console") -> None:
        super().__init__()
        self._console = console

    def emit(self, record: logging.LogRecord) -> None:
        self._console.print(
            self.format(record), highlight=False, markup=False, soft_wrap=True, emoji=False
        )


class Notebook(Surface):
    """A line below the running cell; the line stays after the work."""

    def open(self) -> None:
        """Add the line to the cell's output."""
        display = _kernel_display()
        assert display is not None
        self._handle = display({"text/plain": ""}, raw=True, display_id=True)

    def show(self, line: Line) -> None:
        """Replace the line."""
        self._handle.update({"text/plain": line(NOTEBOOK_WIDTH)}, raw=True)

    def close(self, line: Line) -> None:
        """Show the final line."""
        self.show(line)


class Pipe(Surface):
    """A new line on standard error for each update."""

    first_s = 10.0
    period_s = 10.0

    def show(self, line: Line) -> None:
        """Write the line, unless the pipe is closed."""
        with suppress(ValueError):  # raised if the pipe is closed
            try:
                print(line(shutil.get_terminal_size().columns - 1), file=sys.stderr, flush=True)
            except OSError:
                silence(sys.stderr)
