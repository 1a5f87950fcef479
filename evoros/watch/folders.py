"""What the folders of runs have at a moment: states, logs, and whether figures would change."""

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from evoros.analysis.tables.folders import shorten_names
from evoros.base.errors import InputError
from evoros.files.regular import open_regular
from evoros.session.overview import Overview, survey
from evoros.storage.discovery import folders_below
from evoros.storage.layout import LOG, RUNNING, STATUS

FIGURES_OF = (
    *("config.yaml", "manifest.json", "setting.json", "generations", "designs.csv"),
    *("requirements.csv", "worst_cases.csv", "champion/certificate.json"),
)
"""Files and folders of a run that change when its figures do."""
LOG_BYTES, LOG_LINES = 16_384, 60
"""The end of a log that is read, and the lines that are shown."""
Stamp = tuple[int, int]


@dataclass(frozen=True)
class Look:
    """The runs and evaluations at a moment."""

    overviews: tuple[Overview, ...]
    empty: tuple[Path, ...]
    """Folders that have no run yet."""
    stamps: tuple[object, ...]
    """Equal in two looks if the figures of both are the same."""
    log: tuple[str, ...]
    """The last lines of all logs, by their dates."""
    names: Mapping[Path, str]
    """Short names of the runs."""


@dataclass
class Folders:
    """Folders that are looked at again and again; their files are read only after changes."""

    paths: Sequence[Path]
    _known: dict[Path, tuple[Stamp | None, Overview]] = field(default_factory=dict)
    _logs: dict[Path, tuple[Stamp | None, list[str]]] = field(default_factory=dict)

    def check(self) -> None:
        """Require that each folder has runs, or nothing yet.

        Raises:
            InputError: one is a file, or has files but no run.
        """
        for path in self.paths:
            if path.exists() and not path.is_dir():
                raise InputError(f"{path}: must be a folder, and is none; correct the path")
            if not _find(path) and any(files for _, _, files in os.walk(path)):
                raise InputError(
                    f"{path}: must be the folder of a run, an evaluation or a sweep, or one above "
                    f"such, or a folder without files, which may still get one; correct the path"
                )

    def look(self) -> Look:
        """Look at all folders; their files may be missing or changing."""
        found = {path: _find(path) for path in self.paths}
        runs = list(dict.fromkeys(run for below in found.values() for run in below))
        overviews, names = tuple(map(self._survey, runs)), name_runs(runs)
        return Look(
            overviews,
            tuple(path for path, below in found.items() if not below),
            tuple(_stamp_figures(overview) for overview in overviews),
            tuple(self._read_logs(names)),
            names,
        )

    def _survey(self, run: Path) -> Overview:
        """Read the state of a run; only that of a running one changes without its file."""
        stamp = _stamp(run / STATUS)
        known, overview = self._known.get(run, (None, None))
        if overview is None or known != stamp or overview.state == RUNNING:
            overview = survey(run)
            self._known[run] = stamp, overview
        return overview

    def _read_logs(self, names: Mapping[Path, str]) -> list[str]:
        """Read the last lines of all logs; those of several runs have the run's name."""
        dated = []
        for run in names:
            stamp = _stamp(run / LOG)
            if run not in self._logs or self._logs[run][0] != stamp:
                self._logs[run] = stamp, list(_read_end(run / LOG))
            name = f"{names[run]}: " if len(names) > 1 else ""
            dated += [(line[:23], name, line) for line in self._logs[run][1]]
        dated.sort(key=lambda entry: entry[0])  # by their dates
        last = dated[-LOG_LINES:]
        return [f"{date[:19]} {name}{line[24:].removeprefix('INFO ')}" for date, name, line in last]


def name_runs(runs: Sequence[Path]) -> dict[Path, str]:
    """Name runs by what differs between them: jobs of a sweep by their own levels."""
    names = shorten_names(runs)
    words = {run: name.split("_") for run, name in names.items()}
    common = set.intersection(*map(set, words.values())) if len(words) > 1 else set()
    short = {
        run: "_".join(word for word in words[run] if word not in common) or name
        for run, name in names.items()
    }
    return short if len(set(short.values())) == len(short) else names


def _find(path: Path) -> list[Path]:
    return list(folders_below(path, lambda reason: None))


def _stamp_figures(overview: Overview) -> object:
    stamps = tuple(_stamp(overview.path / name) for name in FIGURES_OF)
    return overview.path, overview.state, stamps


def _stamp(path: Path) -> Stamp | None:
    """Return what changes with the content of a file or the names in a folder."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_mtime_ns, status.st_size


def _read_end(path: Path) -> Iterator[str]:
    """Yield the dated lines at the end of a log; no tracebacks."""
    try:
        with open_regular(path) as file:
            file.seek(-min(LOG_BYTES, os.fstat(file.fileno()).st_size), os.SEEK_END)
            lines = file.read(LOG_BYTES).decode(errors="replace").splitlines()
    except OSError:
        return
    yield from [line for line in lines if line[:4].isdigit() and line[4:5] == "-"][-LOG_LINES:]
