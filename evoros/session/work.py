"""Draws the figures of a run, and opens the pool for its missions."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from pathlib import Path
from typing import TypeAlias

from evoros.base.errors import single_line
from evoros.executor.processes import Processes, available_cores
from evoros.executor.protocol import Executor, Pool
from evoros.files.disk import sync
from evoros.storage.layout import REQUIREMENTS, WORST_CASES, evaluates
from evoros.terminal.activity import announce
from evoros.terminal.log import LOGGER, silence_unwritable

FIGURES = "figures"  # subfolder of the run folder
WORST, PAGE = "worst", "requirements"  # figures of an evaluation
DrawFigures: TypeAlias = Callable[[Path, str, Path], Sequence[str]]
"""Draws a figure (run folder, name, target folder) and returns warnings; picklable."""


def list_figures(run: Path, configured: Sequence[str]) -> Sequence[str]:
    """List the configured figures of a search, or the figures that show an evaluation's results."""
    if not evaluates(run):
        return configured
    results = {WORST: WORST_CASES, PAGE: REQUIREMENTS}
    return [name for name, file in results.items() if (run / file).is_file()]


def draw_figures(run: Path, names: Sequence[str], pool: Pool, draw: DrawFigures) -> None:
    """Draw the missing figures of a finished run, and log their folder; log errors as warnings."""
    missing = [name for name in names if not has_figure(run, name)]
    if missing:
        workers = min(len(missing), available_cores())
        here = nullcontext(pool) if pool.shares_files else Processes(workers).open()
        with announce("drawing figures"), here as drawing:
            _draw_missing(run, missing, drawing, draw)
    present = [name for name in names if has_figure(run, name)]
    if present:
        LOGGER.info("figures in %s: %s", run / FIGURES, ", ".join(present))


def _draw_missing(run: Path, names: Sequence[str], pool: Pool, draw: DrawFigures) -> None:
    calls = {name: pool.submit(draw, run, name, run / FIGURES) for name in names}
    for name, call in calls.items():
        try:
            warnings = call.result()
        except CancelledError:  # the run was interrupted
            raise
        except Exception as error:
            warnings = [f"cannot be drawn ({type(error).__name__}: {single_line(error)})"]
        for warning in warnings:
            LOGGER.warning("%s: %s: %s", run / FIGURES, name, warning)


def discard_figures(run: Path, names: Sequence[str]) -> None:
    """Delete the figures that become outdated when the run continues."""
    files = [file for name in names for file in _list_files(run, name)]
    for file in files:
        file.unlink()
    if files:
        sync(run / FIGURES)


def _list_files(run: Path, name: str) -> list[Path]:
    return sorted((run / FIGURES).glob(f"{name}[._]*"))


def has_figure(run: Path, name: str) -> bool:
    """Return True if a figure's picture, written last, exists and none of its files is empty."""
    files = _list_files(run, name)
    pictures = [file for file in files if file.stem == name and file.suffix != ".csv"]
    return bool(pictures) and all(file.stat().st_size for file in files)


PoolOpener: TypeAlias = Callable[[Executor], AbstractContextManager[Pool]]
"""Opens the pool for an executor's missions; all jobs of a sweep share one pool."""


@contextmanager
def open_pool(executor: Executor) -> Iterator[Pool]:
    """Open a pool for a single run."""
    silence_unwritable()
    with ExitStack() as stack:
        with announce("starting workers"):  # can take minutes on a cluster
            pool = stack.enter_context(executor.open())
        yield pool
