"""CSV tables of designs; ``docs/evaluation.md`` documents the columns."""

import csv
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from io import StringIO
from math import isfinite
from pathlib import Path

from evoros.base.errors import InputError
from evoros.design.design import Design
from evoros.design.region import Region
from evoros.design.space import FixedSensor
from evoros.evolution.experiment import Experiment
from evoros.files.resources import read_file
from evoros.formats.strict_xml import quote
from evoros.mission.member import Member
from evoros.sensor.protocol import Mount
from evoros.storage.champion_files import DESIGN_COLUMNS, sensor_rows, table_by_robot
from evoros.storage.layout import DESIGN_FILE, GENE_FILE
from evoros.storage.tables import AGENT
from evoros.terminal.log import LOGGER

DESIGN_FILE_COLUMNS = ("source", *DESIGN_COLUMNS)
GENE_FILE_COLUMNS = ("source", "design", "key", "value")
NEEDED = ("design", "sensor", "x_m", "y_m", "yaw_deg")

DesignName = tuple[str, str]  # source, and design name within the source


@dataclass(frozen=True)
class NamedDesign:
    """A design, the source it was read from, and its name within the source."""

    source: str
    name: str
    design: Design


@dataclass
class DesignDraft:
    """A partially read design for one robot."""

    at: str  # file and line of the first row of the design
    rows: int = 0  # number of rows in the table of sensors
    mounts: dict[int, Mount] = field(default_factory=dict)  # keyed by sensor index
    values: dict[str, float] = field(default_factory=dict)  # other evolved values, by key

    @property
    def design(self) -> Design:
        """The design that the rows read so far describe."""
        return Design(tuple(mount for _, mount in sorted(self.mounts.items())), self.values)


Drafts = dict[DesignName, dict[str, DesignDraft]]  # keyed by design, robot as in ``Design.parts``


def read_recorded_designs(folder: Path, experiment: Experiment) -> list[NamedDesign]:
    """Read the designs in an evaluation's folder."""
    drafts = read_drafts(folder / DESIGN_FILE, None, experiment.members)
    add_genes(drafts, folder / GENE_FILE, None)
    return fit_designs(drafts, experiment)


def write_designs(designs: Sequence[NamedDesign]) -> dict[str, str]:
    """Return the contents of the files for ``read_recorded_designs``, by file name."""
    sensors: list[Sequence[object]] = []
    genes: list[Sequence[object]] = []
    for named in designs:
        name = (named.source, named.name)
        sensors += [[*name, *row] for row in sensor_rows(named.design)]
        for robot, design in named.design.parts.items():
            genes += [[*name, key, value, robot] for key, value in design.values.items()]
    whole = [named.design for named in designs]
    return {
        DESIGN_FILE: table_by_robot(DESIGN_FILE_COLUMNS, sensors, whole),
        GENE_FILE: table_by_robot(GENE_FILE_COLUMNS, genes, whole),
    }


def fit_designs(drafts: Drafts, experiment: Experiment) -> list[NamedDesign]:
    """Complete the drafts, and sort each robot's sensors."""
    return [_fit(name, parts, experiment) for name, parts in drafts.items()]


def _fit(
    name: DesignName, drafts: Mapping[str, DesignDraft], experiment: Experiment
) -> NamedDesign:
    try:
        read = Design.join({robot: draft.design for robot, draft in drafts.items()})
        design = experiment.space.complete(read)
        members = experiment.scenario.equip(design)
    except InputError as error:
        raise InputError(f"{drafts[''].at}: design {quote(name[1])}: {error}") from None
    fitted = {
        member.name: Design(member.robot.mounts, design.parts[member.name].values)
        for member in members
        if member.has_own_design
    }
    return NamedDesign(*name, Design.join(fitted))


def read_drafts(path: Path, source: str | None, members: Sequence[Member]) -> Drafts:
    """Read a table of sensors; if ``source`` is None, its column ``source`` names the sources."""
    needed = NEEDED if source is not None else ("source", *NEEDED)
    optional = (*(name for name in DESIGN_COLUMNS if name not in needed), AGENT)
    drafts: Drafts = {}
    for line, cells in read_rows(path, needed, optional):
        name = (cells.get("source", source) or "", cells["design"])
        _add_row(drafts, name, f"{path}: line {line}", cells, members)
    if not drafts:
        raise InputError(f"{path}: must have at least one design; add a row")
    return drafts


def _add_row(
    drafts: Drafts, name: DesignName, at: str, cells: Mapping[str, str], members: Sequence[Member]
) -> None:
    if not cells["design"]:
        raise InputError(f"{at}: design is empty; name the design in each row")
    robot = cells.get(AGENT) or ""
    naming = ("source", "design", AGENT)
    bare = not any(value for key, value in cells.items() if key not in naming)
    by_name = {member.name: member for member in members}
    if robot not in by_name:
        if bare:
            LOGGER.warning(
                "%s: the row is ignored, because the agent %s does not exist and the row has no "
                "sensor",
                at,
                robot,
            )
            return
        known = ", ".join(filter(None, by_name)) or "none"
        raise InputError(
            f"{at}: agent must be one of the experiment's agents ({known}), not {quote(robot)}; "
            f"add it with agents=..., or remove the row"
        )
    draft = drafts.setdefault(name, {"": DesignDraft(at)}).setdefault(robot, DesignDraft(at))
    draft.rows += 1
    if draft.rows > 1 and (bare or not draft.mounts):
        raise InputError(
            f"{at}: design {quote(name[1])} must have either rows with sensors or a single row "
            f"without a sensor; remove this row"
        )
    if bare:
        return
    index, mount = _read_mount(at, cells, by_name[robot])
    if index in draft.mounts:
        raise InputError(
            f"{at}: design {quote(name[1])} has sensor {index} twice; number its sensors 0, 1, ..."
        )
    draft.mounts[index] = mount


def _read_mount(at: str, cells: Mapping[str, str], member: Member) -> tuple[int, Mount]:
    """Read the index and mount of a sensor; the robot's defaults replace empty cells."""
    if not re.fullmatch(r"[0-9]{1,9}", cells["sensor"]):
        raise InputError(
            f"{at}: sensor must be a non-negative integer, not {quote(cells['sensor'])}; "
            f"number the sensors of a design 0, 1, 2 ..."
        )
    types = list(member.design.sensors)
    kind = cells.get("type") or (types[0] if len(types) == 1 else "")
    if kind not in types:
        raise InputError(
            f"{at}: type must be one of {', '.join(types) or 'none'}, not {quote(kind)}; choose "
            f"one of these, or add the type to design.sensors"
        )
    return int(cells["sensor"]), _read_place(at, kind, cells, member)


def _read_place(at: str, kind: str, cells: Mapping[str, str], member: Member) -> Mount:
    x, y, yaw = (float(_parse(at, name, cells[name])) for name in ("x_m", "y_m", "yaw_deg"))
    z, pitch = (
        float(_parse(at, name, cells[name])) if cells.get(name) else None
        for name in ("z_m", "pitch_deg")
    )
    robot, design = member.robot, member.design
    if kind not in design.placed_types:
        link = cells.get("link") or robot.mount_link
        return FixedSensor(kind, link, x, y, z or 0.0, yaw, pitch or 0.0).bind(robot, at)
    overhang = max([area.overhang_m for area in design.regions.values()], default=0.05)
    try:
        region = Region(x, y, yaw, z, pitch, cells.get("link") or None, overhang)
    except InputError as error:
        raise InputError(f"{at}: {str(error).removeprefix('Region.')}") from None
    bound = region.bind(robot, False, f"{at}: sensor", tuple(design.sensors.values()))
    z, pitch = bound.ranges["z_m"][0], bound.ranges["pitch_deg"][0]
    return Mount(kind, bound.link, x, y, z, yaw, pitch)


def add_genes(drafts: Drafts, path: Path, source: str | None) -> None:
    """Add evolved values from a table to the drafts, except the values of mounts."""
    needed = ("design", "key", "value") if source is not None else GENE_FILE_COLUMNS
    for line, cells in read_rows(path, needed, ("gene", AGENT)):
        at = f"{path}: line {line}"
        parts = drafts.get((cells.get("source", source) or "", cells["design"]))
        robot = cells.get(AGENT) or ""
        draft = None if parts is None else parts.setdefault(robot, DesignDraft(at))
        if draft is None or cells["key"] in draft.values:
            raise InputError(
                f"{at}: {quote(cells['key'])} of design {quote(cells['design'])} is repeated, or "
                f"belongs to no design; restore the file"
            )
        draft.values[cells["key"]] = _parse(at, "value", cells["value"])


def _parse(at: str, name: str, content: str) -> float:
    with suppress(ValueError, OverflowError):
        value = int(content) if re.fullmatch(r"[+-]?[0-9]+", content) else float(content)
        if isfinite(value):
            return value
    raise InputError(f"{at}: {name} must be a number, not {quote(content)}")


def read_rows(
    path: Path, required: Sequence[str], optional: Sequence[str]
) -> Iterator[tuple[int, dict[str, str]]]:
    """Yield the line number and the cells, keyed by column, of each nonempty row."""
    try:
        rows = csv.reader(StringIO(read_file(path).decode("utf-8-sig"), newline=""), strict=True)
        names = [name.strip() for name in next(rows, [])]
        _check_columns(path, names, required, optional)
        for row in rows:
            if len(row) not in (0, len(names)):
                raise InputError(
                    f"{path}: line {rows.line_num}: must have {len(names)} cells, like the "
                    f"first line, not {len(row)}; add or delete cells"
                )
            if row:
                cells = (" ".join(cell.split()) for cell in row)
                yield rows.line_num, dict(zip(names, cells, strict=True))
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: must be a CSV file in UTF-8 ({error}); convert it") from error


def _check_columns(
    path: Path, names: Sequence[str], required: Sequence[str], optional: Sequence[str]
) -> None:
    known = ", ".join((*required, *optional))
    for name in required:
        if name not in names:
            raise InputError(
                f"{path}: line 1: must have the column {name}, but has "
                f"{quote(', '.join(names)) if any(names) else 'none'}; the columns are {known}"
            )
    for name in names:
        if name not in (*required, *optional) or names.count(name) > 1:
            problem = "repeats the" if names.count(name) > 1 else "has the unknown"
            raise InputError(
                f"{path}: line 1: {problem} column {quote(name)}; the columns are {known}"
            )
