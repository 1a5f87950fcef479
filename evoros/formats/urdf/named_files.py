"""Finds the meshes and textures that a robot description names."""

import logging
from collections.abc import Sequence
from pathlib import Path

from lxml.etree import _Element as Element

from evoros.base.errors import InputError
from evoros.formats.missing import Absence, Absences, Remedy
from evoros.formats.notes import Notes
from evoros.formats.strict_xml import element_error, locate, place_of, source_of
from evoros.formats.urdf.installed import find_in_any_case
from evoros.formats.urdf.installed import locate as locate_installed
from evoros.formats.urdf.packages import PackageIndex
from evoros.formats.urdf.xacro_packages import IGNORED

EXPANDED = " (expanded)"
"""Ends the name of a description whose lines differ from its file's."""

_LOG = logging.getLogger(__name__)
_MESH_SCHEMES = ("package://", "model://", "file://")


def resolve_files(root: Element, file: Path, packages: PackageIndex) -> None:
    """Replace the names of existing meshes and textures by their addresses (``file:///...``).

    Elements that show or collide with a file of an ignored package are removed. A mesh that is
    missing keeps its name: whether it matters depends on its part.

    Raises:
        InputError: a file is not local, or lies outside of the folders that may be read.
    """
    left_out: list[str] = []
    notes = Notes(_LOG)
    for element in list(root.iter("mesh", "texture")):
        name = element.get("filename")
        if not name:
            raise element_error(element, "must have a filename", "add it")
        if _package_of(name) in packages.ignored:
            left_out.append(name)
            _remove_part(element)
        else:
            element.set("filename", _resolve(name, element, file, packages, notes))
    for name in left_out:
        notes.tell(f"{file}: left out, because its package is ignored: {name}", "ignored", name)
    notes.report()


def collect_absent_meshes(root: Element, absences: Absences, packages: PackageIndex) -> None:
    """Collect the absent meshes that links collide with.

    If there are some, or packages are absent, those are added that links show which collide with
    nothing: they are needed if such a link is a wheel, or the body.
    """
    links = root.findall("link")
    bare = [link for link in links if link.find("collision") is None]
    meshes = [mesh for link in links for mesh in link.iterfind("collision/geometry/mesh")]
    if absences.names() or any(map(_is_absent, meshes)):
        meshes += [mesh for link in bare for mesh in link.iterfind("visual/geometry/mesh")]
    for mesh in filter(_is_absent, meshes):
        name = str(mesh.get("filename"))
        package = _package_of(name)
        folder = packages.find(package) if package else None
        if folder is not None:
            remedy = Remedy("complete the folder {}", str(folder))
        elif package:
            remedy = Remedy("add the folder that holds {} to robot.packages", package)
        else:
            remedy = Remedy("correct the path {}", name)
        sentence = f"{locate(mesh)} names the absent mesh {name}"
        absences.add(Absence("mesh", name, _place(mesh), sentence, remedy))


def _is_absent(mesh: Element) -> bool:
    name = str(mesh.get("filename")).removeprefix("file://")
    return not name.startswith(IGNORED) and not Path(name).is_file()


def _place(mesh: Element) -> str:
    """Return the line of a mesh in its file, or its link if the line is not one of the file."""
    if not source_of(mesh).endswith(EXPANDED):
        return place_of(mesh)
    link = next(mesh.iterancestors("link"))
    return f"link {link.get('name')}"


def _remove_part(element: Element) -> None:
    """Remove the visual, collision or material that an element belongs to."""
    parts = ("visual", "collision", "material")
    part = next((e for e in element.iterancestors() if e.tag in parts), element)
    parent = part.getparent()
    if parent is not None:
        parent.remove(part)


def _package_of(name: str) -> str:
    """Return the package of ``package://NAME/...`` and ``model://NAME/...``; else nothing."""
    scheme = next((s for s in ("package://", "model://") if name.startswith(s)), "")
    return name[len(scheme) :].partition("/")[0] if scheme else ""


def _resolve(name: str, element: Element, file: Path, packages: PackageIndex, notes: Notes) -> str:
    """Return the real path of a named file, or the name itself if there is no such file."""
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
            return _keep_missing(name, element, file, packages)
        text = f"{file}: {name} is found in another case of letters: {real}"
        notes.tell(text, "case of letters", real.name)
        real = real.resolve()
    if not packages.allows(real) and not any(map(real.is_relative_to, above)):
        roots = ", ".join(map(str, packages.roots))
        problem = f"names {name}, which must lie inside {roots}"
        raise element_error(element, problem, "add its folder to the robot's packages")
    return f"file://{real}"


def _find(candidates: Sequence[Path], packages: PackageIndex) -> Path | None:
    """Return the first candidate that is a file, or that a package installs from one."""
    folders = (*packages.roots, *packages.folders.values())
    places = [candidate for candidate in candidates if candidate.is_file()]
    places += [place for place in (locate_installed(c, folders) for c in candidates) if place]
    return next((place.resolve() for place in places if place.is_file()), None)


def _keep_missing(name: str, element: Element, file: Path, packages: PackageIndex) -> str:
    """Return the name of a missing file that a part shows or collides with; refuse any other."""
    if any(above.tag in ("visual", "collision") for above in element.iterancestors()):
        return name
    folders = ", ".join(map(str, packages.roots))
    raise InputError(
        f"{file}: {name}: must be an existing file inside {folders}; "
        f"add its folder to the robot's packages"
    )
