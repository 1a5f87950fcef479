"""Rows of the leaderboard, with a run's result and the overrides that repeat the run.

A task is an experiment in ``conf/`` with a budget of missions; only the handling of noise may vary.
"""

import csv
import hashlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path
from typing import Any

from evoros.base.errors import InputError, override, shell_line
from evoros.config.compose import compose
from evoros.config.recorded import flatten, list_differences, read_recorded
from evoros.files.nested import parse_json
from evoros.mission.plan import VALIDATION
from evoros.observers import protocol
from evoros.session.reproduction import list_finished
from evoros.storage.layout import CONFIG, MANIFEST, MISSIONS, evaluates, read_bytes, read_json
from evoros.storage.reading import Run
from evoros.storage.tables import to_csv

PREFIX = "benchmark_"
TASKS: Mapping[str, int] = {  # maximum number of missions per run, excluding validation
    "benchmark_boxes": 300,
    "benchmark_network": 800,
    "benchmark_priced": 800,
}
GROUPS = ("optimizer", "allocation", "final_choice")
SEARCH = (*GROUPS, "trials", "draws", "seed", "objectives", "descriptors", "treatment")
"""Keys, or prefixes of keys, that a search may set."""
TRIALS = "optimizer.validation_trials"  # fixed by the task, because the score depends on it
FREE = (*protocol.FREE, "figures", "record")  # keys that do not affect missions
HASHED = (
    *(MISSIONS, "generations/*.csv"),
    *("champion/design.csv", "champion/genes.csv", "champion/certificate.json"),
)
"""The files of a run that the digest of its row covers."""


@dataclass(frozen=True)
class Row:
    """A row of the leaderboard; all cells are strings."""

    task: str  # name of the experiment without PREFIX
    search: str  # option of the group ``optimizer``
    seed: str
    missions: str  # number of missions, excluding validation
    fitness: str  # fitness of the champion on the task's fresh trials
    low: str  # lower bound of the fitness
    high: str  # upper bound of the fitness
    completed: str  # fraction of these trials that were completed
    overrides: str  # arguments of ``evoros`` as typed in a shell
    config_dir: str  # folder in the repository with the search's parts; empty if it has none
    version: str  # version of evoros
    digest: str  # SHA-256 of the run's files that the overrides determine

    @property
    def name(self) -> str:
        """The task, search and seed of the row."""
        return f"{self.task}, {self.search}, seed {self.seed}"


COLUMNS = tuple(field.name for field in fields(Row))


def make_row(folder: Path, config_dir: str | None = None) -> Row:
    """Return the row of a finished run; ``config_dir`` is the folder with the search's parts."""
    if config_dir and Path(config_dir).is_absolute():
        raise InputError(
            f"--config-dir {config_dir}: must be a relative path, so that others can rerun the "
            f"row; start in the root of the repository"
        )
    if list_finished(folder, "a row") != [folder] or evaluates(folder):
        problem = "must be the folder of one run, not of an evaluation or a sweep"
        raise InputError(f"{folder}: {problem}; give the runs one by one")
    task, overrides = _list_overrides(folder, config_dir)
    missions = int((Run(folder).missions.purpose != VALIDATION).sum())
    if missions > TASKS[task]:
        raise InputError(
            f"{folder}: {missions} missions besides validation, but the budget of {task} "
            f"is {TASKS[task]}; repeat the run with fewer generations"
        )
    try:
        return _fill_row(folder, task, missions, overrides, config_dir)
    except (ValueError, TypeError, LookupError, ArithmeticError, AttributeError) as error:
        raise InputError(
            f"{folder}: the manifest or certificate is damaged or was edited ({error!r}); "
            f"repeat the run"
        ) from error


def _fill_row(
    folder: Path, task: str, missions: int, overrides: Sequence[str], config_dir: str | None
) -> Row:
    manifest = read_json(folder / MANIFEST)
    certificate = parse_json(read_bytes(folder / "champion" / "certificate.json"))
    return Row(
        task.removeprefix(PREFIX),
        str(manifest["choices"]["optimizer"]),
        str(manifest["seed"]),
        str(missions),
        *_describe_certificate(certificate),
        shell_line(*overrides),
        config_dir or "",
        str(manifest["packages"]["evoros"]),
        hash_run(folder),
    )


def _describe_certificate(certificate: Mapping[str, Any]) -> tuple[str, str, str, str]:
    names = "validated_fitness", "fitness_low", "fitness_high"
    worlds = certificate["worlds"].values()
    completed = sum(w["completed"] for w in worlds) / sum(w["trials"] for w in worlds)
    fitness, low, high = (f"{certificate[name]:.3f}" for name in names)
    return fitness, low, high, f"{completed:.2f}"


def hash_run(folder: Path) -> str:
    """Return a digest of the files that a run's configuration determines, without their seals."""
    files = sorted(path for pattern in HASHED for path in folder.glob(pattern))
    whole = hashlib.sha256()
    for path in files:
        content = read_bytes(path)
        if path.name == MISSIONS:
            content = b"\n".join(line.rpartition(b",")[0] for line in content.splitlines())
        name = path.relative_to(folder).as_posix()
        whole.update(f"{name} {hashlib.sha256(content).hexdigest()}\n".encode())
    return whole.hexdigest()


def _list_overrides(folder: Path, config_dir: str | None) -> tuple[str, list[str]]:
    recorded = flatten(read_recorded(folder / CONFIG))
    choices = read_json(folder / MANIFEST).get("choices", {})
    strange: dict[str, list[str]] = {}
    for task in TASKS:
        wanted = compose([f"experiment={task}"], config_dir=config_dir)
        task_values = flatten(wanted)
        strange[task] = list_differences(recorded, task_values, (*FREE, *SEARCH))
        if recorded.get(TRIALS, task_values[TRIALS]) != task_values[TRIALS]:
            strange[task].append(TRIALS)
        if not strange[task]:
            other = [group for group in GROUPS if choices.get(group) != wanted.choices.get(group)]
            chosen = [f"{group}={choices.get(group)}" for group in other]
            return task, _add_values([f"experiment={task}", *chosen], recorded, config_dir)
    nearest = min(strange, key=lambda task: len(strange[task]))
    raise InputError(
        f"{folder}: not the configuration of a task ({', '.join(TASKS)}); it differs from "
        f"{nearest} in {', '.join(strange[nearest])}; give these keys the values of "
        f"experiment={nearest}"
    )


def _add_values(
    overrides: list[str], recorded: Mapping[str, Any], config_dir: str | None
) -> list[str]:
    wanted = flatten(compose(overrides, config_dir=config_dir))
    for key in list_differences(recorded, wanted, FREE):
        sign = "" if key in wanted else "+"
        typed = override(f"{sign}{key}", recorded[key]) if key in recorded else f"~{key}"
        overrides = [*overrides, typed]
    left = list_differences(recorded, flatten(compose(overrides, config_dir=config_dir)), FREE)
    if left:
        raise InputError(f"{left[0]}: no override gives this value; set the key with an override")
    return overrides


def write_rows(rows: Iterable[Row]) -> str:
    """Return the rows as CSV, with a header line."""
    return to_csv([COLUMNS, *map(astuple, rows)])


def read_rows(path: Path) -> list[Row]:
    """Read the rows of a file written by ``write_rows``."""
    try:
        table = list(csv.reader(path.read_text(encoding="utf-8").splitlines()))
    except (OSError, ValueError, csv.Error) as error:
        raise InputError(f"{path}: not a readable CSV file ({error}); correct the file") from error
    if not table or tuple(table[0]) != COLUMNS:
        raise InputError(f"{path}: line 1 must be {','.join(COLUMNS)}; correct the header")
    for number, cells in enumerate(table[1:], 2):
        if len(cells) != len(COLUMNS):
            raise InputError(
                f"{path}: line {number} must have {len(COLUMNS)} cells, not {len(cells)}; "
                f"correct the line"
            )
    return [Row(*cells) for cells in table[1:]]
