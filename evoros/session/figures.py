"""Draws the figures of a finished run, and pictures of robots and worlds.

Workers draw the figures of runs, so that only they load what drawing needs.
"""

import io
import shutil
from collections.abc import Mapping, Sequence
from concurrent.futures import CancelledError
from contextlib import AbstractContextManager, ExitStack, nullcontext, redirect_stdout
from logging import WARNING
from pathlib import Path
from typing import TYPE_CHECKING, Any

from evoros.analysis.subcommands import EXPORTS, SUBCOMMANDS
from evoros.base.activity import announce
from evoros.base.arrays import Array
from evoros.base.checks import Rule
from evoros.base.errors import InputError, single_line
from evoros.base.log import LOGGER, collect_messages, detach
from evoros.executor.processes import Processes, available_cores
from evoros.executor.protocol import Pool

if TYPE_CHECKING:
    from evoros.robot.model import Robot
    from evoros.world.model import World

FIGURES = "figures"
"""The folder of the figures, in that of the run."""
PICTURE_IN = 4.5  # width of the picture of a world


_NAMES = tuple(name for name in SUBCOMMANDS if name not in EXPORTS)


def _is_drawable(value: Any) -> bool:
    listed = isinstance(value, list | tuple) and all(name in _NAMES for name in value)
    return listed and len(set(value)) == len(value)


DRAWABLE = Rule(
    f"a list of subcommands of evoros-analyze, each once ({', '.join(_NAMES)})", _is_drawable
)


def check_figures(names: Sequence[str]) -> None:
    """Refuse a value of the key ``figures`` before the run starts.

    Raises:
        InputError: a name is no subcommand of evoros-analyze, or is there twice.
    """
    if not DRAWABLE.holds(names):
        raise InputError(f"figures: must be {DRAWABLE.text}, not {names!r}; set it to such a value")


def draw_figures(run: Path, names: Sequence[str], pool: Pool) -> None:
    """Draw the figures that are missing into the folder of a finished run, and log where.

    An error in drawing becomes a warning of one line and changes nothing else.
    """
    missing = [name for name in names if not has_figure(run, name)]
    if missing:
        here = nullcontext(pool) if pool.shares_files else _start_processes(len(missing))
        with announce("drawing figures"), here as drawing:
            _draw_missing(run, missing, drawing)
    present = [name for name in names if has_figure(run, name)]
    if present:
        LOGGER.info("figures in %s: %s", run / FIGURES, ", ".join(present))


def _start_processes(figures: int) -> AbstractContextManager[Pool]:
    return Processes(min(figures, available_cores())).open()


def _draw_missing(run: Path, names: Sequence[str], pool: Pool) -> None:
    calls = {name: pool.submit(draw, run, name) for name in names}
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
    for name in names:
        for file in list_files(run, name):
            file.unlink()


def list_files(run: Path, name: str) -> list[Path]:
    """The files of a subcommand in the run's folder."""
    return sorted((run / FIGURES).glob(f"{name}[._]*"))


def has_figure(run: Path, name: str) -> bool:
    """Whether all files of a subcommand are there; the picture is the last to be moved there."""
    return any(file.stem == name and file.suffix != ".csv" for file in list_files(run, name))


def draw(run: Path, name: str) -> list[str]:
    """Write the files of one subcommand and return its warnings. Runs in a worker.

    The files are written into a draft folder and moved to their places when all are complete.
    """
    from evoros.analysis.command import draw as draw_files
    from evoros.analysis.subcommands import parse

    draft = run / FIGURES / f".{name}.part"
    shutil.rmtree(draft, ignore_errors=True)
    with _silence() as stack:
        messages = stack.enter_context(collect_messages())
        written = draw_files(parse([name, str(run.resolve()), "--output", str(draft)]))
    for file in reversed(written):  # the picture last: has_figure looks for it
        file.replace(draft.parent / file.name)
    draft.rmdir()
    return [record.getMessage() for record in messages if record.levelno >= WARNING]


def _silence() -> ExitStack:
    """Keep a worker off the terminal; the main process reports its warnings."""
    stack = ExitStack()
    stack.enter_context(redirect_stdout(io.StringIO()))
    for handler in LOGGER.handlers:
        stack.enter_context(detach(handler))
    return stack


def draw_robot_picture(robot: "Robot", places: "Mapping[str, Array]") -> bytes:
    """Draw a robot from above and from the side, as PNG; see ``draw_inspected_robot``."""
    from evoros.analysis.drawing.inspection import draw_inspected_robot
    from evoros.analysis.drawing.style import save

    picture = io.BytesIO()
    save(draw_inspected_robot(robot, places), picture, "png")
    return picture.getvalue()


def draw_world_picture(worlds: "Mapping[str, World]") -> bytes:
    """Draw worlds from above with their courses, as PNG."""
    from evoros.analysis.drawing.style import save
    from evoros.analysis.drawing.worlds import draw_worlds

    figure = draw_worlds(worlds, width=PICTURE_IN * len(worlds))
    axes = figure.axes[0]
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    figure.set_figheight(1.0 + (PICTURE_IN - 1.2) * (high - low) / (right - left))
    picture = io.BytesIO()
    save(figure, picture, "png")
    return picture.getvalue()
