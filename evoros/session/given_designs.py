"""The inputs of an evaluation: its designs, and the run that provides its configuration."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from evoros.base.errors import InputError, override, shell_line, single_line, write_count
from evoros.certificate.controls import NO_SENSORS, RANDOM
from evoros.config.configuration import Configuration, check_targets
from evoros.config.like import LIKE, RecordedRun, find_place, is_below
from evoros.config.own_files import NAMED_FOLDERS
from evoros.config.recorded import flatten_recorded, read_recorded
from evoros.evolution.experiment import Experiment
from evoros.files.resources import expand_home
from evoros.formats.strict_xml import parse, quote
from evoros.observers.protocol import FREE
from evoros.optimizer.random_search import RandomSearch
from evoros.robot.model import Robot
from evoros.session.design_tables import (
    DesignName,
    NamedDesign,
    add_genes,
    fit_designs,
    read_drafts,
)
from evoros.storage import layout
from evoros.storage.champion_files import CHAMPION, ROBOT
from evoros.storage.digests import read_original
from evoros.storage.manifest import find_changes
from evoros.storage.verification import read_text, verify_folder
from evoros.terminal.log import LOGGER, warn_left_out

UNUSED = (*FREE, "figures", "treatment", "objectives", "descriptors", "draws", "final_choice")
"""Keys that evaluations ignore."""
OF_VALIDATION = ("optimizer", "allocation", "confirmation", "validation")
"""Further keys that evaluations ignore unless they use the draws of a validation."""


def read_like(source: str, typed: frozenset[str]) -> RecordedRun:
    """Read the configuration of a finished run, or of runs that agree in all keys but ``typed``."""
    first, *others = _list_runs(source)
    ignored = {*UNUSED, *typed, *(() if "evaluation_draws" in typed else OF_VALIDATION)}
    values = flatten_recorded(first / layout.CONFIG)
    for folder in others:
        now = flatten_recorded(folder / layout.CONFIG)
        _require_agreement(source, (first, values), (folder, now), ignored)
    check_targets(read_recorded(first / layout.CONFIG).values, NAMED_FOLDERS, first / layout.CONFIG)
    manifest = layout.read_json(first / layout.MANIFEST)
    text = read_original(first, layout.CONFIG, manifest).decode()
    return RecordedRun(text, manifest.get("choices", {}))


def warn_of_changes(config: Configuration, experiment: Experiment) -> None:
    """Warn about each robot, world or module that has changed since the run given by ``like``."""
    if config.like is None:
        return
    folder = next(iter(_list_runs(config.like)))
    manifest = layout.read_json(folder / layout.MANIFEST)
    typed = {override.lstrip("+~").partition("=")[0] for override in config.overrides}
    for name in find_changes(manifest, experiment, config.text, config.values, {}):
        kind = name.partition(" ")[0]
        changed_by_hand = any(is_below(kind, [key]) or is_below(key, [kind]) for key in typed)
        if kind not in ("configuration", "simulators") and not changed_by_hand:
            LOGGER.warning(
                "like=%s: %s has changed since the run, or its path is relative to %s; restore the "
                "file, or start evoros in that folder",
                *(folder, name, manifest.get("working_directory")),
            )


def _list_runs(source: str) -> list[Path]:
    path = expand_home(source)
    folders = list(layout.folders_below(path, warn_left_out))
    if folders in ([], [path]):
        runs = [path]
    else:  # unfinished runs cause a warning later, when their champions are read
        runs = [folder for folder in folders if not layout.evaluates(folder)]
        finished = [
            run
            for run in runs
            if layout.read_json(run / layout.STATUS).get("state") == layout.FINISHED
        ]
        runs = finished or runs[:1] or [path]
    for run in runs:
        require_finished(run, LIKE)
        version = layout.read_json(run / layout.MANIFEST).get("format_version")
        if version != layout.FORMAT_VERSION:
            raise InputError(
                f"like={run}: format_version must be {layout.FORMAT_VERSION}, not {version!r}; "
                f"use the version of evoros that made the run"
            )
    return runs


def _require_agreement(
    source: str,
    one: tuple[Path, Mapping[str, Any]],
    other: tuple[Path, Mapping[str, Any]],
    ignored: Iterable[str],
) -> None:
    (first, before), (folder, now) = one, other
    for key in dict.fromkeys((*before, *now)):
        if before.get(key) != now.get(key) and not is_below(key, ignored):
            choice = _find_choice(key, first, folder)
            raise InputError(
                f"like={source}: runs must agree on {key}, which is {before.get(key)!r} in "
                f"{first.name} and {now.get(key)!r} in {folder.name}; type {choice}=..., or "
                f"{shell_line(override('like', str(folder)), override('designs', source))}"
            )


def _find_choice(key: str, *runs: Path) -> str:
    # return the group if the runs chose different options of a group that sets the key
    first, other = (layout.read_json(run / layout.MANIFEST).get("choices", {}) for run in runs)
    groups = [group for group in first if first[group] != other.get(group)]
    return next((group for group in groups if is_below(key, [find_place(group)])), key)


GENES_BESIDE = {"design.csv": "genes.csv", layout.DESIGN_FILE: layout.GENE_FILE}
"""Maps a file of designs to the file in the same folder that holds their other evolved values."""


def read_given(sources: Sequence[str], experiment: Experiment) -> list[NamedDesign]:
    """Read and check designs from CSV files, and the champions of runs."""
    designs: list[NamedDesign] = []
    known: set[Path] = set()
    names: set[DesignName] = set()
    for source in sources:
        for path, named in _read_source(source, experiment):
            if path.resolve() in known:
                raise InputError(f"designs: {path} is named twice; remove one of the two")
            known.add(path.resolve())
            for one in named:
                if (one.source, one.name) in names:
                    raise InputError(
                        f"designs: {quote(one.name)} of {one.source} is repeated in {path}; leave "
                        f"out one of the sources"
                    )
                names.add((one.source, one.name))
            designs += named
    return designs


def _read_source(source: str, experiment: Experiment) -> Iterator[tuple[Path, list[NamedDesign]]]:
    path = expand_home(source)
    if not path.exists():
        raise InputError(
            f"{path}: not found; give a CSV file of designs or the folder of a finished run or a "
            f"sweep"
        )
    if not path.is_dir():
        yield path, _read_file(single_line(source), path, experiment)
        return
    folders = list(layout.folders_below(path, warn_left_out))
    if folders in ([], [path]):
        yield path, _read_champion(single_line(source), path, experiment)
        return
    runs = [folder for folder in folders if not layout.evaluates(folder)]
    finished = 0
    for folder in runs:
        name = single_line(str(Path(source, folder.relative_to(path))))
        try:
            champion = _read_champion(name, folder, experiment)
        except InputError as error:
            LOGGER.warning("%s; left out", error)
            continue
        finished += 1
        yield folder, champion
    if not finished:
        raise InputError(
            f"designs={path}: contains {write_count(len(runs), 'run')}, but no champion that can "
            "be scored; finish a run, or give a different folder"
        )


def _read_file(source: str, path: Path, experiment: Experiment) -> list[NamedDesign]:
    column = None if path.name == layout.DESIGN_FILE else source
    drafts = read_drafts(path, column, experiment.members)
    genes = path.with_name(GENES_BESIDE.get(path.name, path.name))
    if genes != path and genes.is_file():
        add_genes(drafts, genes, column)
    return fit_designs(drafts, experiment)


def _read_champion(source: str, path: Path, experiment: Experiment) -> list[NamedDesign]:
    require_finished(path, "designs")
    _compare_robots(path, experiment.robot)
    designs, genes = (path / CHAMPION / name for name in ("design.csv", "genes.csv"))
    drafts = read_drafts(designs, source, experiment.members)
    add_genes(drafts, genes, source)
    champions = fit_designs(drafts, experiment)
    for champion in champions:
        _require_configured(designs, champion, experiment)
    return champions


def _require_configured(path: Path, champion: NamedDesign, experiment: Experiment) -> None:
    for name, design in champion.design.agents.items():
        if experiment.space.find_configured(name) not in (None, design):
            raise InputError(
                f"agents.{name}.design: must be the design that the run used for this agent "
                f"({path}), because it does not evolve; use that design, or give a file of "
                f"designs without rows for the agent {name}"
            )


def _compare_robots(path: Path, robot: Robot) -> None:
    file = path / CHAMPION / ROBOT
    name = parse(read_text(file).encode(), str(file)).get("name") if file.is_file() else None
    if name is not None and name != robot.name:
        LOGGER.warning(
            "%s: the design was evolved on the robot %s, but is scored on %s; to score it with the "
            "run's configuration, type %s",
            *(path, name, robot.name, shell_line(override("like", str(path)))),
        )


def check_controls(experiment: Experiment) -> None:
    """Check before a search that its controls can be run and would differ from the search."""
    for name in () if experiment.controls is None else experiment.controls.designs:
        if name == NO_SENSORS and not any(
            member.design.max_number or member.design.fixed for member in experiment.members
        ):
            problem = "the designs have no sensors"
        elif name == RANDOM and isinstance(experiment.optimizer, RandomSearch):
            problem = "the run itself is a random search"
        else:
            if name not in (NO_SENSORS, RANDOM):
                read_given([name], experiment)
            continue
        raise InputError(
            f"controls.designs: {name} is not a control, because {problem}; leave it out"
        )


def require_finished(path: Path, key: str) -> None:
    """Check that the folder given for ``key`` has a finished run with a champion."""
    if layout.evaluates(path) or not (path / layout.STATUS).is_file():
        file = "a CSV file or " if key == "designs" else ""
        owner = "an evaluation" if (path / layout.DESIGN_FILE).is_file() else "no run"
        raise InputError(
            f"{key}={path}: must be {file}the folder of a finished run or a sweep, but contains "
            f"{owner}; give the folder that evoros printed as the run folder"
        )
    verify_folder(path)
    state = layout.read_json(path / layout.STATUS).get("state")
    if state != "finished" or not (path / CHAMPION / "design.csv").is_file():
        problem = "the champion is missing" if state == "finished" else f"its state is {state}"
        raise InputError(
            f"{key}={path}: must be a finished run with a champion, but {problem}; "
            f"{layout.advise_finish(path)}"
        )
