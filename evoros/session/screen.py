"""Shows a line of progress that changes: on a terminal, in a notebook, or in a pipe."""

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

from evoros.terminal.log import LOGGER, attach, detach, format_for_terminal
from evoros.terminal.unwritable import silence

if TYPE_CHECKING:
    from rich.console import Console

Line: TypeAlias = Callable[[int], str]
"""Returns what is to be shown now, in at most so many characters."""

SEPARATOR = " | "
NOTEBOOK_WIDTH = 100


def fit(parts: Sequence[tuple[int, str]], width: int) -> str:
    """Join the parts of a line that are not empty, in their order, in at most ``width`` characters.

    A part is its rank and its text. If the line is too long, parts of the highest ranks are left
    out; the last one that remains is cut.
    """
    kept = [part for part in parts if part[1]]
    while len(line := SEPARATOR.join(text for _, text in kept)) > width and len(kept) > 1:
        kept.remove(max(kept, key=itemgetter(0)))
    return line if len(line) <= width else line[: width - 1] + "…"


class Surface:
    """A place that shows a changing line."""

    first_s = 0.5
    """Wall clock until the line is shown for the first time: quick work needs none."""
    period_s = 0.5
    """Wall clock between two showings."""

    def open(self) -> None:
        """Prepare for the line."""

    def show(self, line: Line) -> None:
        """Show the line as it is now."""
        raise NotImplementedError

    def close(self, line: Line) -> None:
        """Leave the place to others, with the last state of the line."""


@dataclass
class Screen:
    """Shows a line on a surface from ``start`` to ``stop``, which may be called repeatedly."""

    line: Line
    surface: Surface
    _due: float = field(init=False)  # of time.monotonic
    _stopped: Event = field(init=False, default_factory=Event)
    _thread: Thread | None = None

    def __post_init__(self) -> None:
        self._due = time.monotonic() + self.surface.first_s

    def start(self) -> None:
        """Show the line from now on; a second start has no effect."""
        if self._thread is None:
            self._stopped.clear()
            self._thread = Thread(target=self._repeat, name="progress", daemon=True)
            self._thread.start()

    def stop(self) -> None:
        """Show it no longer."""
        if self._thread is not None:
            self._stopped.set()
            if self._thread.is_alive():  # Ctrl-C may come before ``start`` has started it
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
        """Wait until the line is due, and return whether it is still wanted then."""
        while (left := self._due - time.monotonic()) > 0:
            if self._stopped.wait(left):
                return False
        return not self._stopped.is_set()

    def _show(self) -> None:
        self.surface.show(self.line)
        self._due = time.monotonic() + self.surface.period_s


def open_screen(line: Line) -> Screen:
    """Return a screen for the place where this program runs."""
    if _kernel_display() is not None:
        return Screen(line, Notebook())
    from rich.console import Console

    console = Console(stderr=True)
    if console.is_terminal and not console.is_dumb_terminal:
        return Screen(line, Terminal(console))
    return Screen(line, Pipe())


def _kernel_display() -> Callable[..., Any] | None:
    """Return the function that shows something below the cell of a notebook, if this is one."""
    ipython = sys.modules.get("IPython")  # a notebook has imported it
    shell = None if ipython is None else ipython.get_ipython()
    if ipython is None or getattr(shell, "kernel", None) is None:
        return None
    show: Callable[..., Any] = ipython.display.display
    return show


class Terminal(Surface):
    """The last line of the terminal; what is logged or printed scrolls above it."""

    period_s = 0.25

    def __init__(self, console: "Console") -> None:
        self._console = console
        self._handler = format_for_terminal(_ConsoleHandler(console))
        self._stack = ExitStack()

    def open(self) -> None:
        """Take the messages over from standard error, which is this terminal."""
        from rich.live import Live

        self._live = Live(
            console=self._console,
            auto_refresh=False,
            transient=True,
            redirect_stdout=sys.stdout.isatty(),  # otherwise it is no part of this terminal
        )
        for handler in LOGGER.handlers:
            if isinstance(handler, logging.StreamHandler) and handler.stream is sys.stderr:
                self._stack.enter_context(detach(handler))
        self._stack.enter_context(attach(self._handler))
        self._live.start()

    def show(self, line: Line) -> None:
        """Replace the line; one column stays free, so that no terminal wraps it."""
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
    """A line below the cell that runs, which stays there at the end."""

    def open(self) -> None:
        """Add the line to what the cell shows."""
        display = _kernel_display()
        assert display is not None
        self._handle = display({"text/plain": ""}, raw=True, display_id=True)

    def show(self, line: Line) -> None:
        """Replace the line."""
        self._handle.update({"text/plain": line(NOTEBOOK_WIDTH)}, raw=True)

    def close(self, line: Line) -> None:
        """Show the line as it ended; it stays there."""
        self.show(line)


class Pipe(Surface):
    """Lines on standard error, one below the other, for a file or another program."""

    first_s = 10.0
    period_s = 10.0

    def show(self, line: Line) -> None:
        """Write the line; a reader that has gone is no error."""
        with suppress(ValueError):  # it is closed
            try:
                print(line(shutil.get_terminal_size().columns - 1), file=sys.stderr, flush=True)
            except OSError:
                silence(sys.stderr)
