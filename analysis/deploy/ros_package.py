"""A champion as a ROS 2 package, which builds without code."""

import re
import unicodedata
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from lxml import etree

from evoros.base.errors import InputError

from .ardupilot import (
    INSTANCES,
    describe_orientation,
    list_flown,
    list_range_finders,
    list_single,
    write_parameters,
)
from .champion import Champion, Triple, list_clashes, list_hidden
from .meshes import MeshFiles
from .ros_parameters import controller_parameters, robot_parameters, write_parameter_file

_NAME = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")
_MAINTAINER = re.compile(r"(?P<name>[^<>]*\S)\s*<(?P<email>[\w.+-]+@[\w-]+(\.[\w-]+)+)>")
_TEMPLATES = Environment(
    loader=FileSystemLoader(Path(__file__).parent / "package"),
    autoescape=lambda name: name is not None and ".xml" in name,
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
    keep_trailing_newline=True,
)


@dataclass(frozen=True)
class PackageOptions:
    """The user's choices for a package."""

    name: str
    maintainer: str  # as in an e-mail: NAME <ADDRESS>
    license: str
    imu_m: Triple | None  # where ArduPilot measures from; None: the centre of mass

    def __post_init__(self) -> None:
        if not _NAME.fullmatch(self.name) or len(self.name) < 2:
            raise InputError(
                f"--name: must be lower-case letters, digits and single underscores after a "
                f"letter, not {self.name!r}; choose such a name"
            )
        if not _MAINTAINER.fullmatch(self.maintainer):
            raise InputError(
                f"--maintainer: must be NAME <ADDRESS>, not {self.maintainer!r}; write it like that"
            )
        if not self.license.strip():
            raise InputError("--license: must not be empty; name one, such as BSD-3-Clause")


def name_package(robot: str) -> str:
    """Return a name that ROS accepts for the package of a robot's champion."""
    return f"{_simplify(robot)}_champion"


def _simplify(name: str) -> str:
    """Return a name in lower-case letters, digits and single underscores, after a letter."""
    plain = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode().lower()
    simple = re.sub(r"[^a-z0-9]+", "_", plain).strip("_")
    return simple if simple[:1].isalpha() else f"robot_{simple}".rstrip("_")


def write_package(
    champion: Champion, options: PackageOptions, drawings: Mapping[str, bytes]
) -> tuple[dict[str, bytes], list[str]]:
    """Return the files of a package by their paths in it, and lines on the remaining work."""
    name = _simplify(champion.name)
    meshes = MeshFiles(options.name)
    meshes.move(champion.robot)
    clashes = [*list_clashes(champion.sensors), *list_hidden(champion)]
    notes = [*clashes, *meshes.notes, *_list_left_out(champion)]
    files = {f"urdf/{name}.urdf": etree.tostring(champion.robot, encoding="unicode") + "\n"}
    files |= _write_parameters(champion, options)
    values = {
        **_describe(champion, options),
        "urdf": f"{name}.urdf",
        "launch": f"{name}.launch.py",
        "packages": sorted(meshes.packages),
        "notes": notes,
    }
    files[f"launch/{name}.launch.py"] = _render("launch.py", values)
    contents = {**{path: text.encode() for path, text in files.items()}, **meshes.files, **drawings}
    values["folders"] = sorted({path.partition("/")[0] for path in contents})
    for template in ("package.xml", "CMakeLists.txt", "README.md"):
        contents[template] = _render(template, values).encode()
    return contents, notes


def _render(template: str, values: Mapping[str, Any]) -> str:
    return _TEMPLATES.get_template(f"{template}.jinja").render(values)


def _write_parameters(champion: Champion, options: PackageOptions) -> dict[str, str]:
    controller = write_parameter_file(*controller_parameters(champion), [champion.title])
    robot = write_parameter_file(*robot_parameters(champion), [champion.title])
    finders = list_range_finders(champion.sensors, _choose_origin(champion, options))
    files = {"config/controller.yaml": controller, "config/robot.yaml": robot}
    for version, metres in (("4.7", True), ("4.6", False)):
        bound = "or later" if metres else "or earlier"
        head = [
            f"{champion.title}, for ArduPilot {version} {bound}",
            f"Positions are relative to {_describe_origin(champion, options)}.",
            "Set RNGFNDn_TYPE for your hardware and restart the autopilot before you load this.",
        ]
        files[f"config/ardupilot_{version}.parm"] = write_parameters(
            finders, head, list_flown(champion), metres
        )
    return files


def _describe(champion: Champion, options: PackageOptions) -> dict[str, Any]:
    """Return what the templates say about the champion."""
    maintainer = _MAINTAINER.fullmatch(options.maintainer)
    assert maintainer is not None  # checked by the options
    return {
        "package": options.name,
        "robot": champion.name,
        "maintainer": maintainer.groupdict(),
        "license": options.license,
        "title": champion.title,
        "fitness": _describe_fitness(champion.record.run.status),
        "sensors": champion.sensors,
        "genes": champion.genes,
        "commands": _list_commands(champion),
        "topics": _list_topics(champion),
        "origin": _describe_origin(champion, options),
        "finders": list_range_finders(champion.sensors, _choose_origin(champion, options)),
        "describe_orientation": describe_orientation,
    }


def _list_commands(champion: Champion) -> list[str]:
    """Return the commands that were the controller in the missions."""
    given = [champion.values.get(f"controller.{key}") for key in ("command", "nodes")]
    commands = [given[0]] if given[0] else given[1] or []
    return [line if isinstance(line, str) else " ".join(map(str, line)) for line in commands]


def _list_topics(champion: Champion) -> list[tuple[str, str]]:
    """Return the topics by which nodes of ROS were joined to the missions, by what they carry."""
    start = "controller.topics."
    values = champion.values.items()
    return [(key.removeprefix(start), str(v)) for key, v in values if key.startswith(start)]


def _describe_fitness(status: Mapping[str, Any]) -> str:
    recorded, validated = status.get("best_fitness"), status.get("best_validated_fitness")
    text = f"{recorded:.3f} on the draws that selected it"
    return text if validated is None else f"{text}, and {validated:.3f} on fresh draws"


def _choose_origin(champion: Champion, options: PackageOptions) -> Triple:
    return options.imu_m or champion.centre_m or (0.0, 0.0, 0.0)


def _describe_origin(champion: Champion, options: PackageOptions) -> str:
    place = "({:.4f}, {:.4f}, {:.4f}) m in the robot's frame".format(
        *_choose_origin(champion, options)
    )
    if options.imu_m:
        return f"the autopilot at {place}"
    if champion.centre_m:
        return f"the centre of mass of the description, {place}"
    return "the origin of the robot's frame, for the description has no mass"


def _list_left_out(champion: Champion) -> Sequence[str]:
    single = [sensor for sensor, _ in list_single(champion.sensors)]
    beyond = ", ".join(sensor.link for sensor in single[len(INSTANCES) :])
    others = ", ".join(sensor.link for sensor in champion.sensors if sensor not in single)
    reasons = {
        f"ArduPilot has {len(INSTANCES)} range finders; without parameters are {beyond}": beyond,
        f"ArduPilot is told of range finders only; without parameters are {others}": others,
    }
    return [line for line, names in reasons.items() if names]
