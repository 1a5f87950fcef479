"""Draws the figures of a finished run in workers, so that only these import plotting code."""

import io
import shutil
from collections.abc import Mapping
from contextlib import ExitStack, redirect_stdout
from logging import WARNING
from pathlib import Path
from typing import Any

from evoros.base.errors import InputError
from evoros.files.disk import make_folder, sync
from evoros.terminal.log import LOGGER, collect_messages, detach

from .subcommands import EXPORTS, SUBCOMMANDS, parse


def check_figures(values: Mapping[str, Any]) -> None:
    """Check the configuration key ``figures`` before a run starts."""
    names = values.get("figures", ())
    drawable = [name for name in SUBCOMMANDS if name not in EXPORTS]
    listed = isinstance(names, list | tuple) and all(name in drawable for name in names)
    if not listed or len(set(names)) != len(names):
        raise InputError(
            f"figures: must be a list of different subcommands of evoros analyze "
            f"({', '.join(drawable)}), not {names!r}; type figures=[fitness], for example"
        )


def draw_figure(run: Path, name: str, folder: Path) -> list[str]:
    """Write the files of a subcommand to a folder, in a worker; return the warnings."""
    from .command import draw

    make_folder(folder)  # also syncs the entry in the parent folder
    draft = folder / f".{name}.part"
    shutil.rmtree(draft, ignore_errors=True)
    with _silence() as stack:
        messages = stack.enter_context(collect_messages())
        written, _ = draw(parse([name, str(run.resolve()), "--output", str(draft)]))
    for file in reversed(written):  # the picture last
        sync(file)
        file.replace(folder / file.name)
    draft.rmdir()
    sync(folder)
    return [record.getMessage() for record in messages if record.levelno >= WARNING]


def _silence() -> ExitStack:
    stack = ExitStack()
    stack.enter_context(redirect_stdout(io.StringIO()))
    for handler in LOGGER.handlers:
        stack.enter_context(detach(handler))
    return stack
