"""A folder of a study: a run, or an evaluation of given designs."""

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd

from evoros.base.errors import InputError, single_line
from evoros.files.nested import read_yaml
from evoros.fitness.naming import UNBOUNDED
from evoros.storage.doubts import warn_not_run
from evoros.storage.figure_context import FigureContext
from evoros.storage.layout import FINISHED, SECRETS, advise_finish
from evoros.storage.reading import Run, load_run, read_table

from .factors import read_choices, read_given

_REFERENCE = re.compile(r"\$\{([\w.]+)\}")  # reference to another key
_DEPTH = 20  # maximum length of a chain of references, which may be circular
FITNESS = "fitness"
SECRET = "secret "  # prefix of the digest of a secret value; labels omit the digest


@dataclass(frozen=True, eq=False)
class Record:
    """A run of a study."""

    name: str  # shortest suffix of the run's path that is unique in the study
    run: Run
    context: FigureContext
    values: Mapping[str, Any]  # configuration values by dotted key
    treatment: str = ""  # label that states how it differs from other runs
    levels: Mapping[str, str] = field(default_factory=dict)  # level by factor
    given: Mapping[str, Any] = field(default_factory=dict)  # the user's description
    agent: str = ""  # name of the robot in this record; empty for the first robot

    @property
    def path(self) -> Path:
        """The folder of the run."""
        return self.run.path

    @property
    def choices(self) -> dict[str, str]:
        """The recorded option of each group, by the key of the part that it configures."""
        return read_choices(self.run.manifest.get("choices"))

    @property
    def seed(self) -> int:
        """The configured seed."""
        return int(self.values["seed"])

    @cached_property
    def not_run(self) -> str:
        """A warning if none of the run's missions could be run, otherwise empty."""
        return warn_not_run(self.path)

    @property
    def finished(self) -> bool:
        """True if the run is finished and therefore has a champion."""
        return bool(self.run.status.get("state") == FINISHED)

    @property
    def generations_done(self) -> int:
        """The number of finished generations."""
        return int(self.run.status.get("generations_done") or 0)

    @property
    def progress(self) -> str:
        """A message about the progress of an unfinished run."""
        done, wanted = self.generations_done, self.run.status.get("generations")
        return f"{self.path}: not finished; shown up to generation {done} of {wanted}"

    def require_finished(self) -> None:
        """Raise an error unless the run is finished and therefore has a champion."""
        if not self.finished:
            state = self.run.status.get("state")
            raise InputError(
                f"{self.path}: no champion yet, because the run is not finished (state: "
                f"{state}); {advise_finish(self.path)}"
            )


class EvaluationRecord(Record):
    """An evaluation of given designs."""

    @cached_property
    def mounts(self) -> pd.DataFrame:
        """One row per sensor of the given designs, or per design without sensors."""
        return read_table(self.path / "designs_in.csv", ("x_m", "y_m", "z_m", "yaw_deg"))

    @cached_property
    def genes(self) -> pd.DataFrame:
        """One row per evolved value of the given designs, except mounts."""
        return read_table(self.path / "genes_in.csv", ("value",))


def read_record(folder: Path, name: str) -> Record:
    """Read the run or evaluation in a folder; large tables are read on first use."""
    run = load_run(folder)
    kind = EvaluationRecord if run.evaluates else Record
    secrets = {key: SECRET + digest for key, digest in run.manifest.get(SECRETS, {}).items()}
    values = read_values(folder / "config.yaml") | secrets
    if not isinstance(values.get("seed"), int):
        raise InputError(
            f"{folder / 'config.yaml'}: seed must be an integer, not {values.get('seed')!r}; "
            f"restore the file"
        )
    _ = run.status  # raises if the file is damaged
    return kind(name, run, FigureContext.read(folder), values, given=read_given(values))


def label_fitness(records: Iterable[Record]) -> str:
    """Return the title and unit of the fitness, or "fitness" if records differ."""
    labels = {record.context.fitness.label for record in records}
    return labels.pop() if len(labels) == 1 else FITNESS


def bound_scores(records: Iterable[Record]) -> tuple[float, float]:
    """Return the bounds of the fitness over all records; infinite if unbounded."""
    bounds = {record.context.fitness.bounds or UNBOUNDED for record in records} or {UNBOUNDED}
    lows, highs = zip(*bounds, strict=True)
    return min(lows), max(highs)


def read_values(path: Path) -> dict[str, Any]:
    """Read all values of a ``config.yaml``, including lists, with references resolved."""
    try:
        tree, _ = read_yaml(path)
    except (OSError, ValueError) as error:
        raise InputError(
            f"{path}: not valid YAML ({single_line(error)}); restore the file"
        ) from error
    if not isinstance(tree, dict):
        raise InputError(f"{path}: must be a mapping of keys to values; restore the file")
    return dict(_flatten(tree, tree, ()))


def _flatten(
    node: Mapping[str, Any], tree: Mapping[str, Any], parents: tuple[str, ...]
) -> Iterator[tuple[str, Any]]:
    for key, value in node.items():
        path = (*parents, str(key))
        resolved = _resolve(value, tree)
        if isinstance(resolved, dict) and resolved and len(path) < _DEPTH:
            yield from _flatten(resolved, tree, path)
        else:
            yield ".".join(path), resolved


def _resolve(value: Any, tree: Mapping[str, Any]) -> Any:
    for _ in range(_DEPTH):
        match = _REFERENCE.fullmatch(value) if isinstance(value, str) else None
        if match is None:
            return value
        node: Any = tree
        for name in match[1].split("."):
            if not isinstance(node, dict) or name not in node:
                return value
            node = node[name]
        value = node
    return value
