"""Writes a champion as a ROS 2 package that needs no compilation."""

import re
import unicodedata
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from lxml import etree
from lxml.etree import _Element as Element

from evoros.base.errors import InputError
from evoros.formats.urdf.expansion import list_named_files
from evoros.plugins.deploy import parameters
from evoros.plugins.deploy.champion import Champion, Triple, list_clashes, list_hidden

KINDS = (".stl", ".dae", ".obj", ".ply", ".glb", ".gltf", ".png", ".jpg", ".jpeg", ".tga", ".bmp")
"""Suffixes of files that are copied; a description could name any other file as well."""
_UNSAFE = re.compile(r"[^A-Za-z0-9_.-]")
_NAMED = re.compile(rb"<init_from>\s*([^<\s]+)\s*</init_from>|^mtllib\s+(\S+)", re.M)
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
    maintainer: str  # NAME <ADDRESS>
    license: str
    imu_m: Triple | None  # origin of ArduPilot's body frame; None for the centre of mass

    def __post_init__(self) -> None:
        if not _NAME.fullmatch(self.name) or len(self.name) < 2:
            raise InputError(
                f"--name: must be a letter followed by lower-case letters, digits and single "
                f"underscores, not {self.name!r}; choose a name such as rover_champion"
            )
        if not _MAINTAINER.fullmatch(self.maintainer):
            raise InputError(f"--maintainer: must be NAME <ADDRESS>, not {self.maintainer!r}")
        if not self.license.strip():
            raise InputError("--license: must not be empty; name a licence, such as BSD-3-Clause")


def simplify(name: str) -> str:
    """Reduce a name to lower-case letters, digits and single underscores, with a letter first."""
    plain = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode().lower()
    simple = re.sub(r"[^a-z0-9]+", "_", plain).strip("_")
    return simple if simple[:1].isalpha() else f"robot_{simple}".rstrip("_")


def write_package(
    champion: Champion, options: PackageOptions, drawings: Mapping[str, bytes]
) -> tuple[dict[str, bytes], list[str]]:
    """Return the files of a package by path, and notes on the remaining work for the user."""
    name = simplify(champion.name)
    meshes = MeshFiles(options.name)
    meshes.move(champion.robot)
    overlaps = [*list_clashes(champion.sensors), *list_hidden(champion)]
    notes = [*overlaps, *meshes.notes, *_list_left_out(champion)]
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
    written = {
        "config/controller.yaml": parameters.controller_parameters(champion),
        "config/robot.yaml": parameters.robot_parameters(champion),
    }
    head = [champion.title]
    files = {name: parameters.write_ros_file(*both, head) for name, both in written.items()}
    finders = _list_finders(champion, options)
    for version, metres in (("4.7", True), ("4.6", False)):
        bound = "or later" if metres else "or earlier"
        head = [
            f"{champion.title}, for ArduPilot {version} {bound}",
            f"Positions are relative to {_describe_origin(champion, options)}.",
            "Set RNGFNDn_TYPE for your hardware, and restart the autopilot before you load this "
            "file.",
        ]
        files[f"config/ardupilot_{version}.parm"] = parameters.write_ardupilot_file(
            finders, head, parameters.list_flown(champion), metres
        )
    return files


def _describe(champion: Champion, options: PackageOptions) -> dict[str, Any]:
    maintainer = _MAINTAINER.fullmatch(options.maintainer)
    assert maintainer is not None  # checked by PackageOptions
    values, status = champion.values, champion.record.run.status
    fitness = f"{status.get('best_fitness'):.3f} on the draws used for selection"
    if (validated := status.get("best_validated_fitness")) is not None:
        fitness += f", and {validated:.3f} on fresh draws"
    command = values.get("controller.command")
    commands = [command] if command else values.get("controller.nodes") or []
    start = "controller.topics."
    topics = {key: str(value) for key, value in values.items() if key.startswith(start)}
    return {
        "package": options.name,
        "robot": champion.name,
        "maintainer": maintainer.groupdict(),
        "license": options.license,
        "title": champion.title,
        "fitness": fitness,
        "sensors": champion.sensors,
        "genes": champion.genes,
        "commands": [c if isinstance(c, str) else " ".join(map(str, c)) for c in commands],
        "topics": [(key.removeprefix(start), topic) for key, topic in topics.items()],
        "origin": _describe_origin(champion, options),
        "finders": _list_finders(champion, options),
        "describe_orientation": parameters.describe_orientation,
    }


def _list_finders(champion: Champion, options: PackageOptions) -> list[parameters.RangeFinder]:
    return parameters.list_range_finders(champion.sensors, _choose_origin(champion, options))


def _choose_origin(champion: Champion, options: PackageOptions) -> Triple:
    return options.imu_m or champion.centre_m or (0.0, 0.0, 0.0)


def _describe_origin(champion: Champion, options: PackageOptions) -> str:
    numbers = ", ".join(f"{value:.4f}" for value in _choose_origin(champion, options))
    place = f"({numbers}) m in the robot's frame"
    if options.imu_m:
        return f"the autopilot at {place}"
    if champion.centre_m:
        return f"the centre of mass in the description, {place}"
    return "the origin of the robot's frame, because the description has no masses"


def _list_left_out(champion: Champion) -> Sequence[str]:
    single = [sensor for sensor, _ in parameters.list_single(champion.sensors)]
    beyond = ", ".join(sensor.link for sensor in single[len(parameters.INSTANCES) :])
    others = ", ".join(sensor.link for sensor in champion.sensors if sensor not in single)
    limit = len(parameters.INSTANCES)
    reasons = {
        f"ArduPilot supports {limit} range finders; there are no parameters for {beyond}": beyond,
        f"ArduPilot supports only range finders; there are no parameters for {others}": others,
    }
    return [line for line, names in reasons.items() if names]


@dataclass
class MeshFiles:
    """The files in a package's ``meshes/``, with notes on files that were not copied."""

    package: str
    files: dict[str, bytes] = field(default_factory=dict)  # keyed by path in the package
    packages: set[str] = field(default_factory=set)  # other packages named in the description
    notes: list[str] = field(default_factory=list)
    _addresses: dict[str, str] = field(default_factory=dict)

    def move(self, robot: Element) -> None:
        """Copy the files named in a description, and change the names in the description."""
        for element in list_named_files(robot):
            name = element.get("filename", "")
            if name not in self._addresses:
                self._addresses[name] = self._copy(name)
            element.set("filename", self._addresses[name])

    def _copy(self, name: str) -> str:
        """Copy a file; return its address in the package, or its old name if it is not copied."""
        path = Path(name.removeprefix("file://"))
        if not path.is_absolute() or not path.is_file() or path.suffix.lower() not in KINDS:
            self._keep(name)
            return name
        copied = self._free_name(_UNSAFE.sub("_", path.name))
        try:
            self.files[copied] = path.read_bytes()
        except OSError as error:
            raise InputError(
                f"{path}: cannot be read ({error.strerror}); change the file's permissions"
            ) from error
        # Collada meshes name textures, and OBJ meshes name materials
        named = (texture or material for texture, material in _NAMED.findall(self.files[copied]))
        inner = sorted({name.decode(errors="replace") for name in named})
        if inner:
            names = ", ".join(inner)
            self.notes.append(f"{copied} refers to further files, which are not copied: {names}")
        return f"package://{self.package}/{copied}"

    def _keep(self, name: str) -> None:
        package = re.match(r"package://([^/]+)/", name)
        if package:
            self.packages.add(package[1])
            self.notes.append(f"{name}: install its package on the robot")
        else:
            self.notes.append(f"{name} is not copied; add the file, and name it in the description")

    def _free_name(self, name: str) -> str:
        stem, dot, suffix = name.rpartition(".")
        free, count = f"meshes/{name}", 1
        while free in self.files:
            count += 1
            free = f"meshes/{stem}_{count}{dot}{suffix}"
        return free
