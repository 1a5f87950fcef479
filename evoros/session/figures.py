"""The figures of a finished run: finds those that exist, and draws the missing ones."""

from collections.abc import Callable, Sequence
from concurrent.futures import CancelledError
from contextlib import nullcontext
from pathlib import Path
from typing import TypeAlias

from evoros.base.errors import single_line
from evoros.executor.processes import Processes, available_cores
from evoros.executor.protocol import Pool
from evoros.files.disk import sync
from evoros.terminal.activity import announce
from evoros.terminal.log import LOGGER

FIGURES = "figures"
"""The folder of the figures, in that of the run."""
PAGE = "requirements"
"""The figure of an evaluation with requirements: a page."""
Draw: TypeAlias = Callable[[Path, str, Path], Sequence[str]]
"""Draws a named figure of a run into a folder, the picture last, and returns warnings. It pickles.

The commands and the Python interface hand in the one of ``evoros.analysis``.
"""


def draw_figures(run: Path, names: Sequence[str], pool: Pool, draw: Draw) -> None:
    """Draw the figures that are missing into the folder of a finished run, and log where.

    An error in drawing becomes a warning of one line and changes nothing else.
    """
    missing = [name for name in names if not has_figure(run, name)]
    if missing:
        workers = min(len(missing), available_cores())
        here = nullcontext(pool) if pool.shares_files else Processes(workers).open()
        with announce("drawing figures"), here as drawing:
            _draw_missing(run, missing, drawing, draw)
    present = [name for name in names if has_figure(run, name)]
    if present:
        LOGGER.info("figures in %s: %s", run / FIGURES, ", ".join(present))


def _draw_missing(run: Path, names: Sequence[str], pool: Pool, draw: Draw) -> None:
    calls = {name: pool.submit(draw, run, name, run / FIGURES) for name in names}
    for name, call in calls.items():
        try:
            warnings = call.result()
        except CancelledError:  # the pool was closed: the run is interrupted
            raise
        except Exception as error:
            warnings = [f"it cannot be drawn ({type(error).__name__}: {single_line(error)})"]
        for warning in warnings:
            LOGGER.warning("%s: %s: %s", run / FIGURES, name, warning)


def discard_figures(run: Path, names: Sequence[str]) -> None:
    """Delete figures that will be out of date once the run goes on."""
    files = [file for name in names for file in _list_files(run, name)]
    for file in files:
        file.unlink()
    if files:
        sync(run / FIGURES)


def _list_files(run: Path, name: str) -> list[Path]:
    return sorted((run / FIGURES).glob(f"{name}[._]*"))


def has_figure(run: Path, name: str) -> bool:
    """Whether all files of a figure are there; the picture is the last to be moved there.

    A file without content is one that a loss of power has cut.
    """
    files = _list_files(run, name)
    pictures = [file for file in files if file.stem == name and file.suffix != ".csv"]
    return bool(pictures) and all(file.stat().st_size for file in files)
