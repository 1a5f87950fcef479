"""Reads what the folder of a run has recorded as the frozen data that observers get."""

import csv
import io
import json
import math
from collections.abc import Iterator, Mapping
from datetime import datetime
from hashlib import blake2b
from pathlib import Path
from statistics import fmean
from types import MappingProxyType
from typing import Any

from evoros.config.recorded import flatten_recorded
from evoros.evolution.scores import DROPPED
from evoros.files.nested import parse_json
from evoros.measure.protocol import DESCRIPTORS, OBJECTIVES
from evoros.observers.protocol import ObservedEnd, ObservedGeneration, ObservedRun, Value
from evoros.session.figures import FIGURES
from evoros.storage.champion_files import CHAMPION, CHAMPIONS
from evoros.storage.file_reading import read_bytes
from evoros.storage.layout import CONFIG, FINISHED, MANIFEST, STATUS, SWEEP, read_json
from evoros.storage.run_key import read_status_key
from evoros.storage.tables import LOSS, SCREENED, VALIDATED
from evoros.storage.verification import list_tables

CERTIFIED = (
    *("recorded_fitness", "validated_fitness", "fitness_low", "fitness_high"),
    "chance_of_better",
)
"""Numbers of the champion's certificate that observers get."""


class FolderReader:
    """Reads a run folder; tables that it has read are kept, because they stay as they are.

    ``origin`` is the folder in which relative paths of a tracker begin.
    """

    def __init__(self, folder: Path, origin: Path) -> None:
        self.folder, self.origin = folder, origin
        self._generations: list[ObservedGeneration] = []
        self._manifest = read_json(folder / MANIFEST)
        self._parameters = MappingProxyType(dict(_list_parameters(folder)))

    def read(self, generations: int | None, state: str | None = None) -> ObservedRun:
        """Read the first ``generations`` of a run, or all, and its end if it has a ``state``."""
        tables = list_tables(self.folder)[:generations]
        for number in range(len(self._generations), len(tables)):
            self._generations.append(_read_generation(tables[number], number))
        manifest = self._manifest
        return ObservedRun(
            id=_identify(manifest),
            name=self.folder.absolute().name,
            sweep=manifest.get(SWEEP),
            parameters=self._parameters,
            origin=self.origin.absolute(),
            started_s=_to_seconds(manifest.get("created")),
            generations=tuple(self._generations[: len(tables)]),
            end=None if state is None else _read_end(self.folder, state),
        )


def _identify(manifest: Mapping[str, Any]) -> str:
    """Return what tells a run from others, also from another one of the same configuration."""
    text = f"{read_status_key(manifest)} {manifest.get('created')}"
    return blake2b(text.encode(), digest_size=16).hexdigest()


def _list_parameters(folder: Path) -> Iterator[tuple[str, Value]]:
    """Yield the values of the recorded configuration, but for those of the observers."""
    for key, value in flatten_recorded(folder / CONFIG).items():
        if key.partition(".")[0] != "observers":
            plain = value is None or isinstance(value, str | int | float)
            yield key, value if plain else json.dumps(value)


def _read_generation(path: Path, number: int) -> ObservedGeneration:
    rows = list(csv.DictReader(io.StringIO(read_bytes(path).decode())))
    candidates = [row for row in rows if row["operator"] != DROPPED]
    best = max(candidates, key=lambda row: (float(row["fitness"]), bool(row[VALIDATED])))
    metrics = {"mean_fitness": fmean(float(row["fitness"]) for row in rows)}
    for name, cell in best.items():
        if name in ("fitness", VALIDATED, SCREENED, LOSS) or name.startswith(_MEASURES):
            metrics[f"best_{name}"] = float(cell or math.nan)
    return ObservedGeneration(number, _finite(metrics), path.stat().st_mtime)


_MEASURES = (f"{OBJECTIVES}.", f"{DESCRIPTORS}.")


def _read_end(folder: Path, state: str) -> ObservedEnd:
    files, metrics = {}, {}
    if state == FINISHED:
        files = dict(_read_files(folder))
        certificate = parse_json(files[f"{CHAMPION}/certificate.json"].decode())
        metrics = {
            f"champion.{name}": float(certificate[name])
            for name in CERTIFIED
            if certificate[name] is not None
        }
    updated = read_json(folder / STATUS).get("updated")
    return ObservedEnd(state, _finite(metrics), MappingProxyType(files), _to_seconds(updated))


def _read_files(folder: Path) -> Iterator[tuple[str, bytes]]:
    for name in (CHAMPION, CHAMPIONS, FIGURES):
        for path in sorted((folder / name).rglob("[!.]*")):
            if path.is_file():
                yield str(path.relative_to(folder)), read_bytes(path)


def _finite(metrics: Mapping[str, float]) -> Mapping[str, float]:
    """Return the numbers that trackers can draw, and that nobody can change."""
    finite = {name: value for name, value in metrics.items() if math.isfinite(value)}
    return MappingProxyType(finite)


def _to_seconds(date: object) -> float:
    """Return the Unix time of a recorded date; 0 if there is none."""
    return datetime.fromisoformat(date).timestamp() if isinstance(date, str) else 0.0
