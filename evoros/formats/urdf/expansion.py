"""Reads robot descriptions; xacro is expanded in a separate process."""

import logging
import re
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from pathlib import Path

from lxml.etree import _Element as Element

from evoros.base.errors import InputError
from evoros.files.resources import find_file, read_file
from evoros.formats.lenient_xml import parse_leniently
from evoros.formats.missing import Absence, Absences, Remedy
from evoros.formats.notes import Notes
from evoros.formats.strict_xml import element_error, local_tag, locate, parse, place_of, source_of
from evoros.formats.urdf import xacro_child
from evoros.formats.urdf.accessories import leave_out_loose, names_sensor
from evoros.formats.urdf.packages import PackageIndex, find_in_any_case, index_packages
from evoros.formats.urdf.packages import locate as locate_installed
from evoros.formats.urdf.solids import find_turning
from evoros.formats.urdf.xacro_expansion import ReadOptions, choose_instead, expand, format_argument
from evoros.formats.urdf.xacro_packages import IGNORED

_LOG = logging.getLogger(__name__)
_XACRO = re.compile(xacro_child.NAMESPACE)
_PLACEHOLDER = re.compile(r"\$\{(\w+)\}")
_LEGACY = ("property[@name]", "macro[@name]", "include[@filename]")  # xacro without a namespace
_WITHOUT_LINKS = ("material", "gazebo", "transmission")
_PREFIX = re.compile(r"(robot_?)?(namespace|ns|prefix)|tf_prefix")


def read(name: str, options: ReadOptions | None = None) -> tuple[Path, Element]:
    """Return the file and root element of a URDF, or of an expanded xacro file.

    In the result, files are named by address (``file:///...``) if they exist, otherwise as before.
    """
    options = options or ReadOptions()
    file = find_file(name, "robots")
    content = read_file(file)
    root = parse_leniently(content, str(file))
    packages = index_packages(file, options.packages, options.ignored_packages)
    absences = Absences(str(file))
    declared = any(map(_XACRO.search, root.nsmap.values()))
    if file.suffix == ".xacro" or declared or any(map(root.findall, _LEGACY)):
        text, absences = expand(file, options, packages)
        root = parse_leniently(text.encode(), f"{file}{EXPANDED}")
        if packages.ignored:
            leave_out_loose(root, str(file))
        if b"macro" in content and not absences.names():
            _check_robot(root, file)
    else:
        root = _fill_placeholders(content.decode(errors="replace"), file, options.arguments, root)
    if root.tag != "robot":
        problem = f"must be <robot>, not <{local_tag(root)}>"
        raise element_error(root, problem, "name the URDF or xacro file of a robot")
    resolve_files(root, file, packages)
    if options.missing == "error":
        collect_absent_meshes(root, absences, packages)
    absences.require_none(choose_instead(absences, options))
    return file, root


def _check_robot(root: Element, file: Path) -> None:
    if root.tag != "robot" or any(child.tag not in _WITHOUT_LINKS for child in root):
        return
    users = [
        other.name
        for other in sorted(file.parent.rglob("*.xacro"))[:200]
        if other != file and file.name in other.read_text(encoding="utf-8", errors="replace")
    ]
    named = f", for example {', '.join(users[:3])}" if users else ""
    raise InputError(
        f"{file}: must describe a robot, but only defines macros and expands to no <link>; name "
        f"the file that calls the macros{named}"
    )


def _fill_placeholders(
    text: str, file: Path, arguments: Mapping[str, object], root: Element
) -> Element:
    """Return the root with ``${NAME}`` replaced, as launch files do in URDF without xacro."""
    names = sorted(set(_PLACEHOLDER.findall(text)))
    unknown = sorted(set(arguments) - set(names))
    if unknown:
        knows = f"the placeholders {', '.join(names)}" if names else "no arguments"
        raise InputError(
            f"{file}: unknown argument {', '.join(unknown)}, because this plain URDF has "
            f"{knows}; remove the argument or name a .xacro file"
        )
    if not names:
        return root
    values = {name: "" for name in names if _PREFIX.fullmatch(name)}
    values |= {name: format_argument(file, name, value) for name, value in arguments.items()}
    lacking = [name for name in names if name not in values]
    if lacking:
        raise InputError(
            f"{file}: ${{{lacking[0]}}} must have a value, because the file has placeholders but "
            f"does not declare xacro; add ++robot.arguments.{lacking[0]}=VALUE"
        )
    empty = [name for name in names if not values[name]]
    if empty:
        _LOG.warning("%s: the placeholders %s are left empty", file, ", ".join(empty))
    filled = _PLACEHOLDER.sub(lambda match: escape(values[match[1]]), text)
    return parse(filled.encode(), str(file))


EXPANDED = " (expanded)"  # suffix of names whose line numbers are not the file's
_MESH_SCHEMES = ("package://", "model://", "file://")


def resolve_files(root: Element, file: Path, packages: PackageIndex) -> None:
    """Give existing meshes and textures addresses; remove elements of ignored packages."""
    left_out: list[str] = []
    notes = Notes(_LOG)
    for element in list(list_named_files(root)):
        name = element.get("filename")
        if not name:
            raise element_error(element, "must have a filename", "add it")
        if _package_of(name) in packages.ignored:
            left_out.append(name)
            tags = ("visual", "collision", "material")
            part = next((e for e in element.iterancestors() if e.tag in tags), element)
            if (parent := part.getparent()) is not None:
                parent.remove(part)
        else:
            element.set("filename", _resolve(name, element, file, packages, notes))
    for name in left_out:
        text = f"{file}: {name} is left out, because its package is ignored"
        notes.add_line(text, "ignored", name)
    notes.report()


def list_named_files(root: Element) -> Iterator[Element]:
    """Yield the elements of a ``<robot>`` that name files, except SDF in ``<gazebo>``."""
    for child in root:
        if child.tag != "gazebo":
            yield from child.iter("mesh", "texture")


def collect_absent_meshes(root: Element, absences: Absences, packages: PackageIndex) -> None:
    """Collect missing collision meshes and, if any, visual ones of links without collisions."""
    links, turning = root.findall("link"), find_turning(root)
    bare = [link for link in links if link.find("collision") is None]
    meshes = [mesh for link in links for mesh in link.iterfind("collision/geometry/mesh")]
    if absences.names() or any(map(_is_absent, meshes)):
        meshes += [mesh for link in bare for mesh in link.iterfind("visual/geometry/mesh")]
    for mesh in filter(_is_absent, meshes):
        name = str(mesh.get("filename"))
        if names_sensor(next(mesh.iterancestors("link"))):  # designs replace sensors
            continue
        package = _package_of(name)
        folder = packages.find(package) if package else None
        if folder is not None:
            remedy = Remedy("add the missing mesh to the folder {}", str(folder))
        elif package:
            remedy = Remedy("add the folder that holds {} to robot.packages", package)
        else:
            remedy = Remedy("correct the path {}", name)
        sentence = f"{locate(mesh)} names the missing mesh {name}"
        wheel = next(mesh.iterancestors("link")).get("name") in turning
        kind = "wheel" if wheel else "mesh"
        absences.add(Absence(kind, name, _place(mesh), sentence, remedy))


def _is_absent(mesh: Element) -> bool:
    name = str(mesh.get("filename")).removeprefix("file://")
    return not name.startswith(IGNORED) and not Path(name).is_file()


def _place(mesh: Element) -> str:
    if not source_of(mesh).endswith(EXPANDED):
        return place_of(mesh)
    link = next(mesh.iterancestors("link"))
    return f"link {link.get('name')}"


def _package_of(name: str) -> str:
    scheme = next((s for s in ("package://", "model://") if name.startswith(s)), "")
    return name[len(scheme) :].partition("/")[0] if scheme else ""


def _resolve(name: str, element: Element, file: Path, packages: PackageIndex, notes: Notes) -> str:
    scheme = next((s for s in _MESH_SCHEMES if name.startswith(s)), "")
    path = name[len(scheme) :]
    if "://" in path:
        raise InputError(f"{file}: {name}: files must be local; use {', '.join(_MESH_SCHEMES)}")
    package = _package_of(name)
    above = [folder for folder in file.parents if package and folder.name == package]
    candidates = [file.parent / path]
    if package:
        folders = (packages.find(package), *above)
        candidates = [folder / path.partition("/")[2] for folder in folders if folder]
        candidates += [root / path for root in packages.roots]
    real = _find(candidates, packages)
    if real is None:
        real = next((p for p in map(find_in_any_case, candidates) if p and p.is_file()), None)
        if real is None:
            return name
        text = f"{file}: {name} not found; using {real} (upper and lower case differ)"
        notes.add_line(text, "case", real.name)
        real = real.resolve()
    if not packages.allows(real) and not any(map(real.is_relative_to, above)):
        roots = ", ".join(map(str, packages.roots))
        problem = f"names {name}, which must lie inside {roots}"
        raise element_error(element, problem, "or add the file's folder to robot.packages")
    return f"file://{real}"


def _find(candidates: Sequence[Path], packages: PackageIndex) -> Path | None:
    folders = (*packages.roots, *packages.folders.values())
    places = [candidate for candidate in candidates if candidate.is_file()]
    places += [place for place in (locate_installed(c, folders) for c in candidates) if place]
    return next((place.resolve() for place in places if place.is_file()), None)
