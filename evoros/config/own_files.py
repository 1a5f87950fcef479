"""YAML files of the user's robots, worlds and designs."""

import ast
import re
import traceback
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain, count
from pathlib import Path
from typing import Any

import yaml
from hydra.utils import get_class

from evoros.base.errors import InputError, escape
from evoros.files.plugins import conf_folders
from evoros.formats.urdf.sensors import BUMPER
from evoros.robot.own_sensors import OwnSensor

SENSOR = "sensor"
AROUND = "around"
STEP_S = 0.1
"""Common multiple [s] of the bundled simulators' time steps, and divisor of sensor periods."""
_FIXED = "evoros.design.space.FixedSensor"
_MASK = "evoros.filter.mask.Mask"
NAMED_FOLDERS: list[Path] = []
"""Configuration folders named, and thus trusted, by the user in this process."""
ROBOT, WORLD, DESIGN, EXPERIMENT = "robot", "world", "design", "experiment"
_WIDTH = 10_000  # line width that keeps each value on one line

_HEADS = {
    ROBOT: """# {title} conf/robot/own.yaml has all keys.
defaults:
  - own
{choices}  - _self_

""",
    WORLD: """# {title}
{name}:
  _target_: evoros.world.loading.load_world
""",
    DESIGN: """# {title} conf/design/around.yaml has all keys.
defaults:
{choices}  - _self_

""",
}
_COMMENTS = {
    "description": "a .urdf or .xacro file",
    "max_speed_mps": "maximum speed [m/s]; null: from the robot's joint limits",
    "link": "link that carries the sensors; null: chosen automatically",
    "z_m": "height of the sensors in the link's frame [m]; null: chosen automatically",
    "pitch_deg": "pitch of the sensors [deg], nose up positive; null: the lowest rays are level",
    "arguments": "arguments of the xacro file, by name",
    "packages": "further folders to search for packages",
    "sdf": "a .sdf, .world or .xacro file",
    "model_paths": "further folders to search for included models",
    "world_name": "name of one of several worlds in the file",
    "missing": "handling of absent models and meshes: error, leave_out or box",
    "vehicles": "leave_out or hold_still",
    "mesh_up_axis": "ignore or apply <up_axis> in DAE files",
    "actors": "walk or leave_out",
    "mesh_effort": "approximate time to divide meshes into convex parts [min]",
    "home_x_m": "where the robot starts and ends each phase [m]",
    "home_z_m": "height of the robot's frame above the ground when it is set down [m]",
    "home_yaw_rad": "left positive [rad]",
    "waypoints": "corners [x, y] [m]; home is appended",
    "acceptance_m": "a waypoint counts as visited within this distance [m]",
    "time_limit_s": "maximum simulated time of the mission [s]",
    "direction": "direction of the first phase: random, forward, backward or parity; or one_way",
    "end_on_collision": "whether touching an obstacle ends the mission",
}
_DESIGN_COMMENTS = {
    "sensors": "types of sensors, by name; conf/sensor has all keys of each",
    "number": "minimum and maximum number of sonars placed by evolution",
    "fixed": "the robot's own sensors, by name, each in its link's frame [m, deg]",
}


@dataclass(frozen=True)
class OwnFile:
    """The YAML file of a part: ``GROUP/NAME.yaml`` in the user's configuration folder."""

    group: str  # robot, world or design
    name: str
    title: str  # comment on the first line
    values: Mapping[str, Any]
    choices: Mapping[str, str | None] = field(default_factory=dict)
    """Defaults list of a design or robot; entries of the same group have the value None."""

    @property
    def path(self) -> str:
        """The path relative to the configuration folder."""
        return f"{self.group}/{self.name}.yaml"

    @property
    def text(self) -> str:
        """The content, with a comment for each key."""
        choices = "".join(
            f"  - {key}\n" if choice is None else f"  - {key}: {choice}\n"
            for key, choice in self.choices.items()
        )
        head = _HEADS[self.group].format(title=self.title, name=self.name, choices=choices)
        comments = _DESIGN_COMMENTS if self.group == DESIGN else _COMMENTS
        return escape(head + _format(self.values, comments, "  " if self.group == WORLD else ""))


def _format(values: Mapping[str, Any], comments: Mapping[str, str], indent: str) -> str:
    lines = []
    for key, value in values.items():
        comment = f"  # {comments[key]}" if key in comments else ""
        if isinstance(value, Mapping) and value:
            inner = _format(value, comments, indent + "  ")
            lines.append(f"{indent}{_dump(key)}:{comment}\n{inner}")
        else:
            lines.append(f"{indent}{_dump(key)}: {_dump(value)}{comment}\n")
    return "".join(lines)


def _dump(value: object) -> str:
    text: str = yaml.safe_dump(value, default_flow_style=True, width=_WIDTH)
    return text.removesuffix("...\n").strip()


def is_bundled(group: str, name: str) -> bool:
    """Return True if a bundled choice has this name, so that Hydra would ignore the user's file."""
    return any((folder / group / f"{name}.yaml").is_file() for folder in conf_folders())


def find_key(place: str, key: str, choices: Mapping[str, str]) -> list[Path]:
    """Find the chosen files that contain ``key`` and provide values at a dotted ``place``."""
    names = []
    for group, choice in choices.items():
        folder, _, at = group.partition("@")
        top = at or folder.replace("/", ".")
        if folder == EXPERIMENT or f"{place}.".startswith(f"{top}."):
            names += [f"{folder}/{name.strip()}.yaml" for name in choice.strip("[]").split(",")]
    folders = (*conf_folders(), *NAMED_FOLDERS)
    files = [file for folder in folders for name in names if (file := folder / name).is_file()]
    pattern = re.compile(rf"^[^#]*\b{re.escape(key)} *:", re.MULTILINE)
    return [file for file in files if pattern.search(file.read_text(encoding="utf-8"))]


_FRAME = re.compile(r'File "(.+?)", line (\d+), in (\S+)')


def locate_fault(error: BaseException) -> str:
    """Return the innermost line of the user's parts that raised an error; empty if none did.

    The formatted traceback is parsed, because worker processes provide nothing else.
    """
    frames = _FRAME.findall("".join(traceback.format_exception(error)))
    tops = [folder.resolve() for folder in NAMED_FOLDERS]
    for path, line, name in reversed(frames):
        if any(Path(path).is_relative_to(top) for top in tops):
            return f"{path}, line {line}, in {_name_class(Path(path), int(line))}{name}: "
    return ""


def _name_class(file: Path, line: int) -> str:
    """Return the names of the classes around a line of a module, each followed by a dot."""
    try:
        tree = ast.parse(file.read_bytes())
    except (OSError, SyntaxError, ValueError):
        return ""
    classes = (node for node in ast.walk(tree) if isinstance(node, ast.ClassDef))
    around = (node.name for node in classes if node.lineno <= line <= (node.end_lineno or 0))
    return "".join(f"{name}." for name in around)


def list_hidden(folder: Path) -> list[tuple[Path, Path]]:
    """List pairs of a bundled file and an unused file of the user with the same name."""
    pairs = [
        (file, folder / file.relative_to(conf))
        for conf in conf_folders()
        for file in sorted(conf.rglob("*.yaml"))
    ]
    return [(own, file) for own, file in pairs if file.is_file() and not file.samefile(own)]


def choose_name(file: Path, group: str) -> str:
    """Return a name for the part in a file, derived from the file's name without suffixes.

    Names of bundled parts get the prefix ``my_``.
    """
    stem = file.name.split(".")[0]
    if stem in ("model", "robot", "world"):  # the folder's name is more specific
        stem = file.resolve().parent.name
    name = re.sub(r"[^A-Za-z0-9]+", "_", stem).strip("_").lower()
    return name if name[:1].isalpha() and not is_bundled(group, name) else f"my_{name}"


def parse_keys(words: Sequence[str]) -> dict[str, Any]:
    """Parse ``key=value`` and ``key.inner=value``, with values in YAML, into nested mappings."""
    values: dict[str, Any] = {}
    for word in words:
        path, equals, text = word.partition("=")
        if not equals or not path:
            raise InputError(f"{word}: must be key=value")
        try:
            value = yaml.safe_load(text)
        except yaml.YAMLError as error:
            raise InputError(f"{word}: the value must be valid YAML; quote it") from error
        *outer, last = path.split(".")
        place = values
        for key in outer:
            place = place.setdefault(key, {})
            if not isinstance(place, dict):
                raise InputError(f"{word}: {key} already has a value; remove one of the two")
        place[last] = value
    return values


def plan_design(
    name: str, title: str, sensors: Sequence[OwnSensor], links: Collection[str]
) -> tuple[OwnFile | None, list[str]]:
    """Plan the file of a design with these sensors; return it with notes on what was changed.

    The file is None if no sensor has a type supported by evoros. ``links`` are the robot's links.
    """
    # Links of mounted sensors are named by type and number.
    taken = {re.sub(r"_[0-9]+$", "", link) for link in links}
    taken |= set(_read_bundled(DESIGN, AROUND)["sensors"])
    types: dict[str, tuple[str, dict[str, Any]]] = {}
    fixed: dict[str, dict[str, Any]] = {}
    notes = []
    for sensor in sensors:
        kind, described = sensor.described.kind, sensor.described.name
        if not is_bundled(SENSOR, kind):
            notes.append(f"left out: sensor {described}: evoros has no sensor type {kind}")
            continue
        settings, changed = _choose_settings(kind, sensor.described.settings)
        unfit = _find_fault(kind, settings)
        if unfit:
            notes.append(f"left out: {sensor.described.place}: sensor {described}: {unfit}")
            continue
        if kind == BUMPER:
            width = _read_bundled(SENSOR, kind)["width_m"]
            changed = [
                *changed,
                f"senses contact in a strip {width:g} m wide in front of its link; set width_m and "
                f"depth_m of the type, and the sensor's pose, in the design",
            ]
        if sensor.masked:
            changed = [*changed, _mask(settings, sensor)]
        notes += [f"sensor {described}: {text}" for text in changed]
        chosen = _name_type(described, (kind, settings), types, taken)
        types[chosen] = (kind, settings)
        fixed[_make_unique(_to_name(described), fixed)] = _place(chosen, sensor)
    if not fixed:
        return None, notes
    values = {
        "sensors": {type_name: settings for type_name, (_, settings) in types.items() if settings},
        "number": [0, 2],
        "fixed": fixed,
    }
    choices = {f"/sensor@sensors.{type_name}": kind for type_name, (kind, _) in types.items()}
    return OwnFile(DESIGN, name, title, values, {AROUND: None, **choices}), notes


def _choose_settings(kind: str, described: Mapping[str, float]) -> tuple[dict[str, Any], list[str]]:
    """Return the settings supported by a type of sensor, and notes on changes."""
    known = _read_bundled(SENSOR, kind)
    settings: dict[str, Any] = {
        key: round(value, 6) for key, value in described.items() if key in known
    }
    for key, value in described.items():
        name, _, field = key.partition(".")
        if field and name in known.get("filters", {}):
            settings.setdefault("filters", {}).setdefault(name, {})[field] = round(value, 9)
    if "period_s" not in settings:
        return settings, []
    stated = settings["period_s"]
    settings["period_s"] = round(max(1, round(stated / STEP_S)) * STEP_S, 6)
    if abs(settings["period_s"] - stated) < 1e-6:
        return settings, []
    return settings, [
        f"measures every {settings['period_s']:g} s, not every {stated:g} s; to change this, "
        f"choose another multiple of the simulator's time step in the design"
    ]


def _mask(settings: dict[str, Any], lidar: OwnSensor) -> str:
    """Mask the beams of a lidar that see its own robot; return a note about it."""
    scan = settings.get("beams", _read_bundled(SENSOR, lidar.described.kind)["beams"])
    beams = [list(span) for span in lidar.masked]
    settings.setdefault("filters", {})["own_body"] = {
        "_target_": _MASK,
        "scan": scan,
        "beams": beams,
    }
    count = sum(last - first + 1 for first, last in beams)
    return (
        f"{count} of its {scan} beams see the robot itself, so the filter own_body masks them; "
        f"mask them on the real robot, too, or delete the filter from the design"
    )


def _find_fault(kind: str, settings: Mapping[str, Any]) -> str:
    plain = {key: value for key, value in settings.items() if key != "filters"}
    try:
        get_class(_read_bundled(SENSOR, kind)["_target_"])(**plain)
    except InputError as error:
        return str(error)
    return ""


def _name_type(
    described: str,
    wanted: tuple[str, dict[str, Any]],
    types: Mapping[str, object],
    taken: Collection[str],
) -> str:
    """Return the name of an equal type, or a new name: the sensor's name without its number."""
    for name, known in types.items():
        if known == wanted:
            return name
    stem = re.sub(r"_*[0-9]+$", "", _to_name(described)) or wanted[0]
    stem = stem if stem not in taken else f"own_{stem}"
    return _make_unique(stem, {*taken, *types})


def _place(type_name: str, sensor: OwnSensor) -> dict[str, Any]:
    x, y, z = sensor.position_m
    place = {"x_m": x, "y_m": y, "z_m": z, "yaw_deg": sensor.yaw_deg, "pitch_deg": sensor.pitch_deg}
    told = {key: value for key, value in place.items() if value != 0.0}
    return {"_target_": _FIXED, "sensor": type_name, "link": sensor.link, **told}


def _to_name(text: str) -> str:
    name = re.sub(r"[^A-Za-z0-9]+", "_", text).strip("_").lower()
    return name if name[:1].isalpha() else f"sensor_{name}".rstrip("_")


def _make_unique(name: str, taken: Collection[str]) -> str:
    names = chain([name], (f"{name}{index}" for index in count(2)))
    return next(unique for unique in names if unique not in taken)


def _read_bundled(group: str, name: str) -> dict[str, Any]:
    """Return the keys of a bundled file, with empty values for keys of its defaults list."""
    paths = (folder / group / f"{name}.yaml" for folder in conf_folders())
    path = next(path for path in paths if path.is_file())
    content: dict[str, Any] = yaml.safe_load(path.read_text(encoding="utf-8"))
    for entry in content.pop("defaults", []):
        for address in entry if isinstance(entry, dict) else ():
            _, _, place = address.partition("@")
            outer, _, inner = place.partition(".")
            content.setdefault(outer, {}).setdefault(inner, {})
    return content
