"""Designs that are given rather than evolved: read from CSV files and run folders, and kept.

``docs/evaluation.md`` documents the columns.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from math import isfinite
from pathlib import Path

from evoros.base.errors import InputError
from evoros.base.intervals import bounds
from evoros.base.log import LOGGER
from evoros.design.design import Design
from evoros.design.region import Region
from evoros.formats.strict_csv import read_rows
from evoros.mission.scenario import Scenario
from evoros.sensor.protocol import Mount
from evoros.storage.discovery import folders_below
from evoros.storage.mission_log import STATUS, command_of, read_json, resume_command
from evoros.storage.run_folder import CHAMPION
from evoros.storage.tables import DESIGN_COLUMNS, GENE_COLUMNS, to_csv

DESIGN_FILE, GENE_FILE = "designs_in.csv", "genes_in.csv"
"""The designs of an evaluation, in its folder: all that they are, wherever they came from."""
KEPT_DESIGN = ("source", *DESIGN_COLUMNS)
KEPT_GENE = ("source", "design", "key", "value")
NEEDED = ("design", "sensor", "x_m", "y_m", "yaw_deg")

Name = tuple[str, str]  # source, name of the design in it


@dataclass(frozen=True)
class NamedDesign:
    """One design that was given: where it comes from, its name there, and what it is."""

    source: str
    name: str
    design: Design


@dataclass
class _Draft:
    """A design as far as it has been read."""

    at: str  # file and line of its first row
    mounts: dict[int, Mount] = field(default_factory=dict)  # by number; empty: without sensors
    values: dict[str, float] = field(default_factory=dict)


def read_given(sources: Sequence[str], scenario: Scenario) -> list[NamedDesign]:
    """The designs of all sources, in order; each fits the robot and the parts of ``scenario``.

    A source is a CSV file, the folder of a finished run, which stands for its champion, or that of
    a sweep, which stands for the champions of all its finished runs.

    Raises:
        InputError: a source cannot be read, or a design is refused.
    """
    given: list[NamedDesign] = []
    known: set[Path] = set()
    for source in sources:
        for each, one in _designs_by_place(source, scenario):
            if each.resolve() in known:
                raise InputError(f"designs: must name each source once, not {each} again; drop one")
            known.add(each.resolve())
            given += one
    return given


def _designs_by_place(source: str, scenario: Scenario) -> Iterator[tuple[Path, list[NamedDesign]]]:
    """The designs of each file or run that a source stands for."""
    path = Path(source).expanduser()
    if not path.exists():
        raise InputError(
            f"{path}: must be a CSV file of designs or the folder of a finished run or of a sweep, "
            f"and there is none; correct the path"
        )
    if not path.is_dir():
        yield path, _all_fitted(_of_file(_one_line(source), path, scenario), scenario)
        return
    below = list(folders_below(path))
    if below in ([], [path]):
        yield path, _all_fitted(_of_run(_one_line(source), path, scenario), scenario)
        return
    runs = [folder for folder in below if command_of(folder) == "evoros"]
    finished = 0
    for folder in runs:
        name = _one_line(str(Path(source, folder.relative_to(path))))
        try:
            champion = _all_fitted(_of_run(name, folder, scenario), scenario)
        except InputError as error:
            LOGGER.warning("%s; left out", error)
            continue
        finished += 1
        yield folder, champion
    if not finished:
        raise InputError(
            f"designs={path}: must hold a finished run whose champion can be scored, and none of "
            f"its {len(runs)} is one; finish one, or give another folder"
        )


def _one_line(name: str) -> str:
    return " ".join(name.split())


def read_kept(folder: Path, scenario: Scenario) -> list[NamedDesign]:
    """The designs that an evaluation has in its folder.

    Raises:
        InputError: a file is missing or damaged.
    """
    drafts = _designs(folder / DESIGN_FILE, None, scenario)
    _add_genes(drafts, folder / GENE_FILE, None)
    return _all_fitted(drafts, scenario)


def to_files(given: Sequence[NamedDesign]) -> dict[str, str]:
    """The files that ``read_kept`` reads, by name: every value is written out in full.

    Sensors are numbered as the robot orders them, which is what ``failed_sensors`` refers to.
    """
    sensors: list[Sequence[object]] = [KEPT_DESIGN]
    genes: list[Sequence[object]] = [KEPT_GENE]
    for one in given:
        name = (one.source, one.name)
        for i, m in enumerate(one.design.mounts):
            pose = (m.x_m, m.y_m, m.z_m, m.yaw_deg, m.pitch_deg)
            sensors.append([*name, i, m.sensor, m.link, *pose])
        if not one.design.mounts:
            sensors.append([*name, *(None for _ in DESIGN_COLUMNS[1:])])
        genes += [[*name, key, value] for key, value in one.design.values.items()]
    return {DESIGN_FILE: to_csv(sensors), GENE_FILE: to_csv(genes)}


def _of_file(source: str, path: Path, scenario: Scenario) -> dict[Name, _Draft]:
    drafts = _designs(path, source, scenario)
    beside = path.with_name("genes.csv")
    if path.name == "design.csv" and beside.is_file() and any(read_rows(beside, GENE_COLUMNS, ())):
        LOGGER.warning(
            "%s: its designs have other genes, in %s, which a file does not bring along: give the "
            "folder of the run",
            path,
            beside,
        )
    return drafts


def _of_run(source: str, path: Path, scenario: Scenario) -> dict[Name, _Draft]:
    """The champion of a run, with its other genes."""
    if command_of(path) != "evoros" or not (path / STATUS).is_file():
        what = "an evaluation's" if (path / DESIGN_FILE).is_file() else "no run's"
        raise InputError(
            f"designs={path}: must be a CSV file or the folder of a finished run or a sweep, and "
            f"the folder is {what}; give the folder that evoros printed as run folder"
        )
    state = read_json(path / STATUS).get("state")
    designs, genes = (path / CHAMPION / name for name in ("design.csv", "genes.csv"))
    if state != "finished" or not designs.is_file():
        raise InputError(
            f"designs={path}: must be a finished run with a champion, and "
            f"{'that is missing' if state == 'finished' else f'its state is {state}'}; type: "
            f"{resume_command(path)}"
        )
    drafts = _designs(designs, source, scenario, least=0)
    if not drafts:  # a champion without sensors has a name only where it has genes
        names = (cells["design"] for _, cells in read_rows(genes, GENE_COLUMNS, ()))
        drafts[source, next(names, CHAMPION)] = _Draft(str(designs))
    _add_genes(drafts, genes, source)
    return drafts


def _designs(
    path: Path, source: str | None, scenario: Scenario, least: int = 1
) -> dict[Name, _Draft]:
    """The designs of one table; without a ``source`` the table has a column of that name."""
    needed = NEEDED if source is not None else ("source", *NEEDED)
    optional = tuple(name for name in DESIGN_COLUMNS if name not in needed)
    drafts: dict[Name, _Draft] = {}
    empty: set[Name] = set()
    for line, cells in read_rows(path, needed, optional):
        at = f"{path}: line {line}"
        if not cells["design"]:
            raise InputError(f"{at}: design must be a name, not empty; give each row its design")
        name = (cells.get("source", source) or "", cells["design"])
        draft = drafts.get(name)
        bare = not any(value for key, value in cells.items() if key not in ("source", "design"))
        if draft is not None and (bare or name in empty):
            raise InputError(
                f"{at}: design {name[1]!r} must have either rows with sensors or one row without; "
                f"remove this row"
            )
        if draft is None:
            draft = drafts[name] = _Draft(at)
        if bare:
            empty.add(name)
            continue
        number, mount = _mount(at, cells, scenario)
        if number in draft.mounts:
            raise InputError(
                f"{at}: design {name[1]!r} must have each sensor once, not {number} again; number "
                f"its sensors 0, 1, 2 ..."
            )
        draft.mounts[number] = mount
    if len(drafts) < least:
        raise InputError(f"{path}: must have at least one design, not none; add a row")
    return drafts


def _mount(at: str, cells: Mapping[str, str], scenario: Scenario) -> tuple[int, Mount]:
    """The sensor of one row, with the robot's own mount where a cell is empty."""
    if not re.fullmatch(r"[0-9]+", cells["sensor"]):
        raise InputError(
            f"{at}: sensor must be a whole number of at least 0, not {cells['sensor']!r}; number "
            f"the sensors of a design 0, 1, 2 ..."
        )
    types = list(scenario.design.sensors)
    kind = cells.get("type") or (types[0] if len(types) == 1 else "")
    if kind not in types:
        raise InputError(
            f"{at}: type must be one of {', '.join(types) or 'none'}, not {kind!r}; name one of "
            f"design.sensors, or add it there"
        )
    x, y, yaw = (float(_number(at, name, cells[name])) for name in ("x_m", "y_m", "yaw_deg"))
    z, pitch = (
        float(_number(at, name, cells[name])) if cells.get(name) else None
        for name in ("z_m", "pitch_deg")
    )
    overhang = max([each.overhang_m for each in scenario.design.regions.values()], default=0.05)
    try:
        place = Region(x, y, yaw, z, pitch, cells.get("link") or None, overhang)
    except InputError as error:
        raise InputError(f"{at}: {str(error).removeprefix('Region.')}") from None
    place = place.on(scenario.robot, False, f"{at}: sensor")
    assert place.link is not None
    z, pitch = bounds(place.z_m)[0], bounds(place.pitch_deg)[0]
    return int(cells["sensor"]), Mount(kind, place.link, x, y, z, yaw, pitch)


def _add_genes(drafts: Mapping[Name, _Draft], path: Path, source: str | None) -> None:
    """Put the other evolved values of the designs into the drafts."""
    needed = ("design", "key", "value") if source is not None else KEPT_GENE
    for line, cells in read_rows(path, needed, ("gene",)):
        at = f"{path}: line {line}"
        draft = drafts.get((cells.get("source", source) or "", cells["design"]))
        if draft is None or cells["key"] in draft.values:
            raise InputError(
                f"{at}: must be another value of one of the designs, not {cells['key']!r} of "
                f"design {cells['design']!r}; restore the file"
            )
        draft.values[cells["key"]] = _number(at, "value", cells["value"])


def _number(at: str, name: str, content: str) -> float:
    """A whole number stays one: some parts accept no other."""
    with suppress(ValueError, OverflowError):
        value = int(content) if re.fullmatch(r"[+-]?[0-9]+", content) else float(content)
        if isfinite(value):
            return value
    raise InputError(f"{at}: {name} must be a number, not {content!r}; correct the cell")


def _all_fitted(drafts: Mapping[Name, _Draft], scenario: Scenario) -> list[NamedDesign]:
    return [_fitted(name, draft, scenario) for name, draft in drafts.items()]


def _fitted(name: Name, draft: _Draft, scenario: Scenario) -> NamedDesign:
    """The design, in the order that the robot gives its sensors."""
    mounts = [mount for _, mount in sorted(draft.mounts.items())]
    try:
        robot = scenario.with_design(Design(tuple(mounts), draft.values)).robot
    except InputError as error:
        raise InputError(f"{draft.at}: design {name[1]!r}: {error}") from None
    return NamedDesign(*name, Design(robot.mounts, draft.values))
