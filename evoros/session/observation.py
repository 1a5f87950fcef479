"""Sends a run's records to observers, during the run or afterwards."""

import csv
import io
import json
import math
import os
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from datetime import datetime
from hashlib import blake2b
from pathlib import Path
from statistics import fmean
from types import MappingProxyType
from typing import TypeAlias

from evoros.base.checks import A_CONTEXT, Rule, ask, check_answer
from evoros.base.errors import InputError, override, shell_line, single_line
from evoros.config.own_files import locate_fault
from evoros.config.recorded import flatten_recorded
from evoros.evolution.scores import DROPPED
from evoros.files.nested import parse_json
from evoros.files.private import SECRET
from evoros.measure.protocol import DESCRIPTORS, OBJECTIVES
from evoros.observers import protocol
from evoros.session.status import BEGUN, survey
from evoros.session.work import FIGURES
from evoros.storage import layout
from evoros.storage.champion_files import CHAMPION, CHAMPIONS
from evoros.storage.layout import read_bytes
from evoros.storage.run_key import read_status_key
from evoros.storage.tables import LOSS, SCREENED, VALIDATED
from evoros.storage.verification import list_tables, verify_folder
from evoros.terminal.activity import announce
from evoros.terminal.log import LOGGER

CERTIFIED = (  # certificate fields that observers receive
    *("recorded_fitness", "validated_fitness", "fitness_low", "fitness_high"),
    "rival_advantage",
)


class FolderReader:
    """Reads a run folder; caches tables, because they never change once written."""

    def __init__(self, folder: Path, origin: Path) -> None:
        self.folder, self.origin = folder, origin
        self._generations: list[protocol.ObservedGeneration] = []
        self._manifest = layout.read_json(folder / layout.MANIFEST)
        self._parameters = MappingProxyType(dict(_list_parameters(folder)))

    def read(self, generations: int | None, state: str | None = None) -> protocol.ObservedRun:
        """Read the first ``generations`` of a run (default: all); with ``state``, also its end."""
        tables = list_tables(self.folder)[:generations]
        for number in range(len(self._generations), len(tables)):
            self._generations.append(_read_generation(tables[number], number))
        manifest = self._manifest
        # The creation date distinguishes runs with the same configuration.
        identity = f"{read_status_key(manifest)} {manifest.get('created')}"
        return protocol.ObservedRun(
            id=blake2b(identity.encode(), digest_size=16).hexdigest(),
            name=self.folder.absolute().name,
            sweep=manifest.get(layout.SWEEP),
            parameters=self._parameters,
            origin=self.origin.absolute(),
            started_s=_to_seconds(manifest.get("created")),
            generations=tuple(self._generations[: len(tables)]),
            end=None if state is None else _read_end(self.folder, state),
        )


def _list_parameters(folder: Path) -> Iterator[tuple[str, protocol.Value]]:
    for key, value in flatten_recorded(folder / layout.CONFIG).items():
        if key.partition(".")[0] != "observers":
            plain = value is None or isinstance(value, str | int | float)
            yield key, value if plain else json.dumps(value)


def _read_generation(path: Path, number: int) -> protocol.ObservedGeneration:
    rows = list(csv.DictReader(io.StringIO(read_bytes(path).decode())))
    candidates = [row for row in rows if row["operator"] != DROPPED]
    best = max(candidates, key=lambda row: (float(row["fitness"]), bool(row[VALIDATED])))
    metrics = {"mean_fitness": fmean(float(row["fitness"]) for row in rows)}
    measures = (f"{OBJECTIVES}.", f"{DESCRIPTORS}.")
    for name, cell in best.items():
        if name in ("fitness", VALIDATED, SCREENED, LOSS) or name.startswith(measures):
            metrics[f"best_{name}"] = float(cell or math.nan)
    return protocol.ObservedGeneration(number, _finite(metrics), path.stat().st_mtime)


def _read_end(folder: Path, state: str) -> protocol.ObservedEnd:
    files, metrics = {}, {}
    if state == layout.FINISHED:
        files = dict(_read_files(folder))
        certificate = parse_json(files[f"{CHAMPION}/certificate.json"].decode())
        metrics = {
            f"champion.{name}": float(certificate[name])
            for name in CERTIFIED
            if certificate[name] is not None
        }
    updated = layout.read_json(folder / layout.STATUS).get("updated")
    return protocol.ObservedEnd(
        state, _finite(metrics), MappingProxyType(files), _to_seconds(updated)
    )


def _read_files(folder: Path) -> Iterator[tuple[str, bytes]]:
    for name in (CHAMPION, CHAMPIONS, FIGURES):
        for path in sorted((folder / name).rglob("[!.]*")):
            if path.is_file():
                yield str(path.relative_to(folder)), read_bytes(path)


def _finite(metrics: Mapping[str, float]) -> Mapping[str, float]:
    """Return the finite metrics; trackers cannot plot NaN or infinity."""
    finite = {name: value for name, value in metrics.items() if math.isfinite(value)}
    return MappingProxyType(finite)


def _to_seconds(date: object) -> float:
    return datetime.fromisoformat(date).timestamp() if isinstance(date, str) else 0.0


Tell: TypeAlias = Callable[[int], None]  # tells observers the number of generations


def ignore(generations: int) -> None:
    """Ignore the number."""


@contextmanager
def observe(folder: Path, observers: Mapping[str, protocol.Observer]) -> Iterator[Tell]:
    """Send a run to its observers while it runs; drop an observer that raises, with a warning."""
    if not observers:
        yield ignore
        return
    origin = Path(str(layout.read_json(folder / layout.MANIFEST).get("working_directory", ".")))
    reader = FolderReader(folder, origin if origin.is_dir() else Path.cwd())
    links = [_Link(folder, name, observer) for name, observer in observers.items()]

    told = 0

    def tell(generations: int) -> None:
        nonlocal told
        told = generations
        for link in links:
            link.tell(lambda: reader.read(generations))

    def finish() -> None:
        written = layout.read_json(folder / layout.STATUS).get("state")
        state = layout.FINISHED if written == layout.FINISHED else layout.STOPPED
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
    folder: Path
    name: str
    observer: protocol.Observer
    send: protocol.Send | None = None
    failed: bool = False
    stack: ExitStack = field(default_factory=ExitStack)

    def open(self, run: protocol.ObservedRun) -> None:
        with self._guard():
            self.send = self.stack.enter_context(open_observer(self.observer, run))
            self.send(run)

    def tell(self, read: Callable[[], protocol.ObservedRun]) -> None:
        with self._guard():
            if self.send is not None:
                self.send(read())

    def close(self) -> None:
        with self._guard():
            self.stack.close()

    @contextmanager
    def _guard(self) -> Iterator[None]:
        try:
            yield
        except Exception as error:  # a library or a user's part may raise any exception
            if not self.failed:
                LOGGER.warning(
                    "observers.%s: %s; the run continues without this observer; to send the "
                    "missing data later, type: %s",
                    *(self.name, describe(error), _export_command(self.folder, self.name)),
                )
            self.send, self.failed = None, True


@contextmanager
def open_observer(
    observer: protocol.Observer, run: protocol.ObservedRun
) -> Iterator[protocol.Send]:
    """Open an observer for a run."""
    with ask("", observer.open, A_CONTEXT, run) as send:
        yield check_answer("", observer.open, Rule("a function (send)", callable), send)


def describe(error: Exception) -> str:
    """Describe a tracker's error in one line, with passwords and keys removed."""
    text = single_line(error)
    if not isinstance(error, InputError):
        text = f"{locate_fault(error)}{type(error).__name__}: {text}"
    for name, value in os.environ.items():
        if len(value) > 3 and SECRET.search(name) and name != "PWD":  # PWD is the current folder
            text = text.replace(value, "***")
    return re.sub(r"(\w+://)[^/\s@]+@", r"\1***@", text)


def _export_command(folder: Path, name: str) -> str:
    """Return the command that exports a run to one observer; references stay unresolved."""
    prefix = f"observers.{name}."
    recorded = flatten_recorded(folder / layout.CONFIG).items()
    keys = [
        override(key.removeprefix(prefix), value)
        for key, value in recorded
        if key.startswith(prefix) and not key.endswith("._target_") and value is not None
    ]
    return shell_line("evoros", "export", name, str(folder), *keys, *layout.name_parts(folder))


def export(folder: Path, observer: protocol.Observer, origin: Path) -> protocol.ObservedRun:
    """Send the records that a tracker lacks; relative paths start from ``origin``."""
    if layout.evaluates(folder) or not (folder / layout.MANIFEST).is_file():
        raise InputError(f"{folder}: must be the folder of a run; correct the path")
    verify_folder(folder)
    state = survey(folder).state
    ended = None if state in (layout.RUNNING, BEGUN) else state
    run = FolderReader(folder, origin).read(None, ended)
    with open_observer(observer, run) as send:
        send(run)
    return run
