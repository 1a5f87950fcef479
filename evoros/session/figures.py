"""A run's own figures: drawn when it is finished, by the workers, which alone load what draws."""

import shutil
from collections.abc import Sequence
from concurrent.futures import CancelledError
from contextlib import ExitStack, redirect_stdout
from io import StringIO
from logging import WARNING
from pathlib import Path
from typing import Any

from evoros.analysis.subcommands import SUBCOMMANDS
from evoros.base.checks import Rule
from evoros.base.errors import InputError
from evoros.base.log import LOGGER, collect_messages, detach
from evoros.executor.protocol import Pool

FIGURES = "figures"
"""Their folder, in that of the run."""


def _drawable(value: Any) -> bool:
    listed = isinstance(value, list | tuple) and all(name in SUBCOMMANDS for name in value)
    return listed and len(set(value)) == len(value)


DRAWABLE = Rule(
    f"a list of subcommands of evoros-analyze, each once ({', '.join(SUBCOMMANDS)})", _drawable
)


def check_figures(names: Sequence[str]) -> None:
    """Refuse a value of the key ``figures`` before the run starts.

    Raises:
        InputError: a name is no subcommand of evoros-analyze, or is there twice.
    """
    if not DRAWABLE.holds(names):
        raise InputError(f"figures: must be {DRAWABLE.text}, not {names!r}; set it to such a value")


def draw_figures(run: Path, names: Sequence[str], pool: Pool) -> None:
    """Draw those that are missing into the folder of a finished run, and say where.

    What cannot be drawn is said in one line and changes nothing else.
    """
    calls = {name: pool.submit(draw, run, name) for name in names if not drawn(run, name)}
    for name, call in calls.items():
        try:
            warnings = call.result()
        except CancelledError:  # the pool is closed: the run is interrupted
            raise
        except Exception as error:
            said = " ".join(str(error).split())
            warnings = [f"it cannot be drawn ({type(error).__name__}: {said})"]
        for warning in warnings:
            LOGGER.warning("%s: %s: %s", run / FIGURES, name, warning)
    there = [name for name in names if drawn(run, name)]
    if there:
        LOGGER.info("figures in %s: %s", run / FIGURES, ", ".join(there))


def discard_figures(run: Path, names: Sequence[str]) -> None:
    """Before a run goes on: they will no longer show what it has."""
    for name in names:
        for file in files(run, name):
            file.unlink()


def files(run: Path, name: str) -> list[Path]:
    """What a subcommand has left in the run's folder."""
    return sorted((run / FIGURES).glob(f"{name}[._]*"))


def drawn(run: Path, name: str) -> bool:
    """Whether all of them are there: the picture is moved to its place last."""
    return any(file.stem == name and file.suffix != ".csv" for file in files(run, name))


def draw(run: Path, name: str) -> list[str]:
    """In a worker: write the files of one subcommand; returns what else was to be said.

    They are moved to their places when all are whole.
    """
    from evoros.analysis.command import draw as draw_files
    from evoros.analysis.subcommands import parse

    draft = run / FIGURES / f".{name}.part"
    shutil.rmtree(draft, ignore_errors=True)
    with _kept_quiet() as stack:
        said = stack.enter_context(collect_messages())
        written = draw_files(parse([name, str(run.resolve()), "--output", str(draft)]))
    for file in reversed(written):  # the picture last: where it is, the rest is
        file.replace(draft.parent / file.name)
    draft.rmdir()
    return [record.getMessage() for record in said if record.levelno >= WARNING]


def _kept_quiet() -> ExitStack:
    """Nothing reaches the terminal from a worker; the main process says what there is to say."""
    stack = ExitStack()
    stack.enter_context(redirect_stdout(StringIO()))
    for handler in LOGGER.handlers:
        stack.enter_context(detach(handler))
    return stack
