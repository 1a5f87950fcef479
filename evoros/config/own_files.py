"""YAML files of the user's robots, worlds and designs."""

import ast
import re
import traceback
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from evoros.base.errors import InputError, escape
from evoros.files.plugins import conf_folders

NAMED_FOLDERS: list[Path] = []  # folders of configuration named, and so trusted, by the user
ROBOT, WORLD, DESIGN, EXPERIMENT = "robot", "world", "design", "experiment"
_WIDTH = 10_000  # line width that keeps each value on one line

_HEADS = {
    ROBOT: """# {title} conf/robot/own.yaml lists all keys.
defaults:
  - own
{choices}  - _self_

""",
    WORLD: """# {title}
{name}:
  _target_: evoros.world.loading.load_world
""",
    DESIGN: """# {title} conf/design/around.yaml lists all keys.
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
    "missing": "handling of missing models and meshes: error, leave_out or box",
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
    "direction": "direction of phase 1: random, forward, backward or parity; one_way: no phase 2",
    "end_on_collision": "whether touching an obstacle ends the mission",
}
_DESIGN_COMMENTS = {
    "sensors": "sensor types, by name; conf/sensor lists all keys of each type",
    "number": "minimum and maximum number of sonars placed by evolution",
    "fixed": "the robot's own sensors, by name, each in its link's frame [m, deg]",
}


@dataclass(frozen=True)
class OwnFile:
    """The YAML file of a part: ``GROUP/NAME.yaml`` in the user's configuration folder."""

    group: str  # robot, world or design
    name: str
    title: str  # comment in the first line
    values: Mapping[str, Any]
    choices: Mapping[str, str | None] = field(default_factory=dict)
    """Defaults list of a design or robot; the value is None for entries of the same group."""

    @property
    def path(self) -> str:
        """The path relative to the configuration folder."""
        return f"{self.group}/{self.name}.yaml"

    @property
    def text(self) -> str:
        """The content, with a comment on each key."""
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
    """Return True if a bundled option has this name, as Hydra would then ignore the user's file."""
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
    """Return the innermost line of the user's parts that raised an error; empty if none did."""
    # worker processes provide nothing but the formatted traceback
    frames = _FRAME.findall("".join(traceback.format_exception(error)))
    tops = [folder.resolve() for folder in NAMED_FOLDERS]
    for path, line, name in reversed(frames):
        if any(Path(path).is_relative_to(top) for top in tops):
            return f"{path}, line {line}, in {_name_class(Path(path), int(line))}{name}: "
    return ""


def _name_class(file: Path, line: int) -> str:
    try:
        tree = ast.parse(file.read_bytes())
    except (OSError, SyntaxError, ValueError):
        return ""
    classes = (node for node in ast.walk(tree) if isinstance(node, ast.ClassDef))
    around = (node.name for node in classes if node.lineno <= line <= (node.end_lineno or 0))
    return "".join(f"{name}." for name in around)


def list_hidden(folder: Path) -> list[tuple[Path, Path]]:
    """List each bundled file with a file of the user that has the same name and is not used."""
    pairs = [
        (file, folder / file.relative_to(conf))
        for conf in conf_folders()
        for file in sorted(conf.rglob("*.yaml"))
    ]
    return [(own, file) for own, file in pairs if file.is_file() and not file.samefile(own)]


def choose_name(file: Path, group: str) -> str:
    """Return a name for the part in a file; with the prefix ``my_`` if a bundled part has it."""
    stem = file.name.split(".")[0]
    if stem in ("model", "robot", "world"):  # the name of the folder is more specific
        stem = file.resolve().parent.name
    name = re.sub(r"[^A-Za-z0-9]+", "_", stem).strip("_").lower()
    return name if name[:1].isalpha() and not is_bundled(group, name) else f"my_{name}"


def parse_keys(words: Sequence[str]) -> dict[str, Any]:
    """Parse ``key=value`` and ``key.inner=value``, with YAML values, into nested mappings."""
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
