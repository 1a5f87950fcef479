"""Snapshots of run folders: states, logs, and time stamps of the files used by figures."""

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from evoros.analysis.tables.loading import shorten_names
from evoros.base.errors import InputError
from evoros.files.disk import open_regular
from evoros.session.status import Overview, survey
from evoros.storage.layout import LOG, RUNNING, STATUS, folders_below

FIGURES_OF = (
    *("config.yaml", "manifest.json", "setting.json", "generations", "designs.csv"),
    *("requirements.csv", "worst_cases.csv", "champion/certificate.json"),
)
"""Files and folders of a run used by figures."""
LOG_BYTES, LOG_LINES = 16_384, 60  # bytes read from the end of a log, and lines shown
Stamp = tuple[int, int]


@dataclass(frozen=True)
class Look:
    """A snapshot of runs and evaluations."""

    overviews: tuple[Overview, ...]
    empty: tuple[Path, ...]  # folders without runs so far
    stamps: tuple[object, ...]  # equal in two snapshots if the figures would be identical
    log: tuple[str, ...]  # last lines of all logs, by date
    names: Mapping[Path, str]  # short names of the runs


@dataclass
class Folders:
    """Folders to read repeatedly; only changed files are read again."""

    paths: Sequence[Path]
    _known: dict[Path, tuple[Stamp | None, Overview]] = field(default_factory=dict)
    _logs: dict[Path, tuple[Stamp | None, list[str]]] = field(default_factory=dict)

    def check(self) -> None:
        """Check that each folder contains runs or no files at all."""
        for path in self.paths:
            if path.exists() and not path.is_dir():
                raise InputError(f"{path}: a file, not a folder; give the folder of a run")
            if not _find(path) and any(files for _, _, files in os.walk(path)):
                raise InputError(
                    f"{path}: contains files, but no run, evaluation or sweep; give the folder of "
                    "a run, or an empty folder"
                )

    def look(self) -> Look:
        """Take a snapshot of all folders; files may be missing or changing."""
        found = {path: _find(path) for path in self.paths}
        runs = list(dict.fromkeys(run for below in found.values() for run in below))
        overviews, names = tuple(map(self._survey, runs)), name_runs(runs)
        empty = tuple(path for path, below in found.items() if not below)
        files = [[_stamp(run.path / name) for name in FIGURES_OF] for run in overviews]
        stamps = zip(((run.path, run.state) for run in overviews), files, strict=True)
        return Look(overviews, empty, tuple(stamps), tuple(self._read_logs(names)), names)

    def _survey(self, run: Path) -> Overview:
        """Read the state of a run, which may change without its file while the run is active."""
        stamp = _stamp(run / STATUS)
        known, overview = self._known.get(run, (None, None))
        if overview is None or known != stamp or overview.state == RUNNING:
            overview = survey(run)
            self._known[run] = stamp, overview
        return overview

    def _read_logs(self, names: Mapping[Path, str]) -> list[str]:
        """Read the last lines of all logs; with several runs, lines start with the run's name."""
        dated = []
        for run in names:
            stamp = _stamp(run / LOG)
            if run not in self._logs or self._logs[run][0] != stamp:
                self._logs[run] = stamp, list(_read_end(run / LOG))
            name = f"{names[run]}: " if len(names) > 1 else ""
            dated += [(line[:23], name, line) for line in self._logs[run][1]]
        dated.sort(key=lambda entry: entry[0])
        last = dated[-LOG_LINES:]
        return [f"{date[:19]} {name}{line[24:].removeprefix('INFO ')}" for date, name, line in last]


def name_runs(runs: Sequence[Path]) -> dict[Path, str]:
    """Name runs by their differences, such as the levels in a sweep."""
    names = shorten_names(runs)
    words = {run: name.split("_") for run, name in names.items()}
    common = set.intersection(*map(set, words.values())) if len(words) > 1 else set()
    rare = {run: "_".join(w for w in words[run] if w not in common) for run in names}
    short = {run: rare[run] or name for run, name in names.items()}
    return short if len(set(short.values())) == len(short) else names


def _find(path: Path) -> list[Path]:
    return list(folders_below(path, lambda reason: None))


def _stamp(path: Path) -> Stamp | None:
    """Return a value that changes with the content of a file, or with the names in a folder."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_mtime_ns, status.st_size


def _read_end(path: Path) -> Iterator[str]:
    try:
        with open_regular(path) as file:
            file.seek(-min(LOG_BYTES, os.fstat(file.fileno()).st_size), os.SEEK_END)
            lines = file.read(LOG_BYTES).decode(errors="replace").splitlines()
    except OSError:
        return
    yield from [line for line in lines if line[:4].isdigit() and line[4:5] == "-"][-LOG_LINES:]
