"""The YAML files of a robot, world or design of the user's own."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from evoros.base.errors import InputError
from evoros.files.resources import bundled_folder

NAMED_FOLDERS: list[Path] = []
"""The configuration folders that the user has named in this process, and so trusts."""
ROBOT, WORLD, DESIGN, EXPERIMENT = "robot", "world", "design", "experiment"
_WIDTH = 10_000  # of a line: a value stays on one

_HEADS = {
    ROBOT: """# {title} conf/robot/own.yaml has all keys.
defaults:
  - own
  - _self_

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
    "max_speed_mps": "null: from the robot's own limits [m/s]",
    "link": "link that carries the sensors; null: chosen for the robot",
    "z_m": "their height in the frame of the link; null: chosen [m]",
    "pitch_deg": "nose up positive; null: the lowest rays are level [deg]",
    "arguments": "arguments of the xacro file, by name",
    "packages": "further folders in which packages are looked for",
    "sdf": "a .sdf, .world or .xacro file",
    "model_paths": "further folders in which included models are looked for",
    "home_x_m": "where the robot starts and ends each phase [m]",
    "home_z_m": "height of the robot's frame above the ground when it is set down [m]",
    "home_yaw_rad": "left positive [rad]",
    "waypoints": "corners [x, y] [m]; home is appended",
    "acceptance_m": "a waypoint counts as visited within this distance [m]",
    "time_limit_s": "maximum simulated time of the mission [s]",
    "direction": "of the first phase: random, forward, backward or parity; or one_way",
    "end_on_collision": "whether touching an obstacle ends the mission",
}
_DESIGN_COMMENTS = {
    "sensors": "types of sensors, by name; conf/sensor has all keys of each",
    "number": "minimum and maximum of sonars that evolution places beside the fixed sensors",
    "fixed": "the robot's own sensors, by name, each in the frame of a link [m, deg]",
}


@dataclass(frozen=True)
class OwnFile:
    """The YAML file of a part: ``GROUP/NAME.yaml`` in the user's configuration folder."""

    group: str  # robot, world or design
    name: str
    title: str  # the first line, a comment
    values: Mapping[str, Any]
    choices: Mapping[str, str | None] = field(default_factory=dict)
    """Defaults of a design: a choice of its own group (None), or of another at an address."""

    @property
    def path(self) -> str:
        """The file, relative to the configuration folder."""
        return f"{self.group}/{self.name}.yaml"

    @property
    def text(self) -> str:
        """The content, each key with a comment."""
        choices = "".join(
            f"  - {key}\n" if choice is None else f"  - {key}: {choice}\n"
            for key, choice in self.choices.items()
        )
        head = _HEADS[self.group].format(title=self.title, name=self.name, choices=choices)
        comments = _DESIGN_COMMENTS if self.group == DESIGN else _COMMENTS
        return head + _format(self.values, comments, "  " if self.group == WORLD else "")


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
    """Return a value in YAML on one line."""
    text: str = yaml.safe_dump(value, default_flow_style=True, width=_WIDTH)
    return text.removesuffix("...\n").strip()


def is_bundled(group: str, name: str) -> bool:
    """Whether evoros has a choice of this name, which Hydra would take instead of the user's."""
    return (bundled_folder("conf") / group / f"{name}.yaml").is_file()


def find_key(place: str, key: str, choices: Mapping[str, str]) -> list[Path]:
    """Find the chosen files that have a key and give values to a dotted ``place``.

    ``choices`` has the chosen file of each group, as a configuration records them.
    """
    names = []
    for group, choice in choices.items():
        folder, _, at = group.partition("@")
        top = at or folder.replace("/", ".")
        if folder == EXPERIMENT or f"{place}.".startswith(f"{top}."):
            names += [f"{folder}/{name.strip()}.yaml" for name in choice.strip("[]").split(",")]
    folders = (bundled_folder("conf"), *NAMED_FOLDERS)
    files = [file for folder in folders for name in names if (file := folder / name).is_file()]
    pattern = re.compile(rf"^[^#]*\b{re.escape(key)} *:", re.MULTILINE)
    return [file for file in files if pattern.search(file.read_text(encoding="utf-8"))]


def list_hidden(folder: Path) -> list[tuple[Path, Path]]:
    """List the bundled files that a user's folder has, too, each with the user's: evoros's win."""
    conf = bundled_folder("conf")
    pairs = [(file, folder / file.relative_to(conf)) for file in sorted(conf.rglob("*.yaml"))]
    return [(own, file) for own, file in pairs if file.is_file() and not file.samefile(own)]


def choose_name(file: Path, group: str) -> str:
    """Return a name for the part that a file describes, from its name without suffixes.

    A name that evoros has already gets ``my_`` in front.
    """
    stem = file.name.split(".")[0]
    if stem in ("model", "robot", "world"):  # the folder tells more
        stem = file.resolve().parent.name
    name = re.sub(r"[^A-Za-z0-9]+", "_", stem).strip("_").lower()
    return name if name[:1].isalpha() and not is_bundled(group, name) else f"my_{name}"


def parse_keys(words: Sequence[str]) -> dict[str, Any]:
    """Parse ``key=value`` and ``key.inner=value`` into nested values, in YAML's notation.

    Raises:
        InputError: a word has no ``=``, or its value is no YAML.
    """
    values: dict[str, Any] = {}
    for word in words:
        path, equals, text = word.partition("=")
        if not equals or not path:
            raise InputError(f"{word}: must be key=value; correct it")
        try:
            value = yaml.safe_load(text)
        except yaml.YAMLError as error:
            raise InputError(f"{word}: must have a value in YAML; correct or quote it") from error
        *outer, last = path.split(".")
        place = values
        for key in outer:
            place = place.setdefault(key, {})
            if not isinstance(place, dict):
                raise InputError(f"{word}: {key} already has a value; remove one of the two")
        place[last] = value
    return values
