"""Tells the observers of a run what its folder has: as it goes on, or later from the folder."""

import os
import re
import shlex
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeAlias

from evoros.base.errors import InputError, single_line
from evoros.config.recorded import flatten_recorded
from evoros.observers.protocol import ObservedRun, Observer, Send
from evoros.session.observed import FolderReader
from evoros.session.overview import BEGUN, survey
from evoros.storage.layout import (
    CONFIG,
    CONFIG_DIR,
    FINISHED,
    MANIFEST,
    RUN,
    RUNNING,
    STATUS,
    STOPPED,
    command_of,
    read_json,
)
from evoros.storage.verification import verify_folder
from evoros.terminal.activity import announce
from evoros.terminal.log import LOGGER

Tell: TypeAlias = Callable[[int], None]
"""Tells the observers of a run that so many of its generations are recorded."""
_SECRET = re.compile(r"KEY|TOKEN|SECRET|PASSWORD|PASSWD|CREDENTIAL", re.IGNORECASE)
"""What the names of variables of the environment have whose values nobody may read."""


def ignore(generations: int) -> None:
    """Tell nobody."""


@contextmanager
def observe(folder: Path, observers: Mapping[str, Observer]) -> Iterator[Tell]:
    """Send a run to its observers: now, whenever it has recorded more, and at its end.

    An error of an observer becomes one warning, and this one is told nothing more.
    """
    if not observers:
        yield ignore
        return
    origin = Path(str(read_json(folder / MANIFEST).get("working_directory", ".")))
    reader = FolderReader(folder, origin if origin.is_dir() else Path.cwd())
    links = [_Link(folder, name, observer) for name, observer in observers.items()]

    told = 0

    def tell(generations: int) -> None:
        nonlocal told
        told = generations
        for link in links:
            link.tell(lambda: reader.read(generations))

    def finish() -> None:
        state = FINISHED if read_json(folder / STATUS).get("state") == FINISHED else STOPPED
        for link in links:
            link.tell(lambda: reader.read(told, state))
            link.close()

    with ExitStack() as stack:
        stack.callback(finish)
        with announce("connecting to trackers"):
            for link in links:
                link.open(reader.read(0))
        yield tell


@dataclass
class _Link:
    """The connection of an observer, until it fails."""

    folder: Path
    name: str
    observer: Observer
    send: Send | None = None
    failed: bool = False
    stack: ExitStack = field(default_factory=ExitStack)

    def open(self, run: ObservedRun) -> None:
        """Connect, and send what a run is."""
        with self._guard():
            self.send = self.stack.enter_context(self.observer.open(run))
            self.send(run)

    def tell(self, read: Callable[[], ObservedRun]) -> None:
        """Send what a run has recorded."""
        with self._guard():
            if self.send is not None:
                self.send(read())

    def close(self) -> None:
        """End the connection."""
        with self._guard():
            self.stack.close()

    @contextmanager
    def _guard(self) -> Iterator[None]:
        """Warn of an error, once, with the command that sends the rest."""
        try:
            yield
        except Exception as error:  # a library, or a part of the user's own, raises anything
            if not self.failed:
                LOGGER.warning(
                    "observers.%s: %s; the run goes on without it; to send what is missing later, "
                    "type: %s",
                    *(self.name, describe(error), _export_command(self.folder, self.name)),
                )
            self.send, self.failed = None, True


def describe(error: Exception) -> str:
    """Describe an error of a tracker in one line, without passwords and keys."""
    text = single_line(error)
    if not isinstance(error, InputError):
        text = f"{type(error).__name__}: {text}"
    for name, value in os.environ.items():
        if len(value) > 3 and _SECRET.search(name):
            text = text.replace(value, "***")
    return re.sub(r"(\w+://)[^/\s@]+@", r"\1***@", text)


def _export_command(folder: Path, name: str) -> str:
    """Return the command that sends a run to one of its observers; references stay unresolved."""
    prefix = f"observers.{name}."
    recorded = flatten_recorded(folder / CONFIG).items()
    keys = [
        f"{key.removeprefix(prefix)}={value}"
        for key, value in recorded
        if key.startswith(prefix) and not key.endswith("._target_") and value is not None
    ]
    config_dir = read_json(folder / MANIFEST).get(CONFIG_DIR)
    option = ["--config-dir", str(config_dir)] if config_dir else []
    return shlex.join(["evoros", "export", name, str(folder), *keys, *option])


def export(folder: Path, observer: Observer, origin: Path) -> ObservedRun:
    """Send what a tracker has not of the run in a folder, and return the run.

    Relative paths of the tracker begin at ``origin``. Errors of the tracker are not caught.

    Raises:
        InputError: the folder has no run, or it is damaged.
    """
    if command_of(folder) != RUN or not (folder / MANIFEST).is_file():
        raise InputError(f"{folder}: must be the folder of a run; give one that evoros has made")
    verify_folder(folder)
    state = survey(folder).state
    run = FolderReader(folder, origin).read(None, None if state in (RUNNING, BEGUN) else state)
    with observer.open(run) as send:
        send(run)
    return run
