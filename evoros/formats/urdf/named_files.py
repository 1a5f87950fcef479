"""Finds the meshes and textures that a robot description names."""

import logging
from pathlib import Path

from lxml.etree import _Element as Element

from evoros.base.errors import InputError
from evoros.formats.strict_xml import element_error
from evoros.formats.urdf.packages import PackageIndex

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
    for element in list(root.iter("mesh", "texture")):
        name = element.get("filename")
        if not name:
            raise element_error(element, "must have a filename", "add it")
        if _package_of(name) in packages.ignored:
            left_out.append(name)
            _remove_part(element)
        else:
            element.set("filename", _resolve(name, element, file, packages))
    if left_out:
        first = left_out[0]
        _LOG.warning("%s: left out %d files of ignored packages: %s", file, len(left_out), first)


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


def _resolve(name: str, element: Element, file: Path, packages: PackageIndex) -> str:
    """Return the real path of a named file, or the name itself if there is no such file."""
    scheme = next((s for s in _MESH_SCHEMES if name.startswith(s)), "")
    path = name[len(scheme) :]
    if "://" in path:
        raise InputError(f"{file}: {name}: files must be local; use {', '.join(_MESH_SCHEMES)}")
    package = _package_of(name)
    if package:
        inner = path.partition("/")[2]
        found = packages.find(package)
        above = [folder for folder in file.parents if folder.name == package]
        candidates = [folder / inner for folder in (*([found] if found else []), *above)]
        candidates += [root / path for root in packages.roots]
    else:
        candidates = [file.parent / path]
    real = next((c.resolve() for c in candidates if c.is_file()), None)
    if real is None:
        return _keep_missing(name, element, file, packages)
    if not packages.allows(real) and not any(real.is_relative_to(f) for f in _named(file, package)):
        roots = ", ".join(map(str, packages.roots))
        problem = f"names {name}, which must lie inside {roots}"
        raise element_error(element, problem, "add its folder to the robot's packages")
    return f"file://{real}"


def _keep_missing(name: str, element: Element, file: Path, packages: PackageIndex) -> str:
    """Return the name of a missing file that a part shows or collides with; refuse any other."""
    if any(above.tag in ("visual", "collision") for above in element.iterancestors()):
        return name
    folders = ", ".join(map(str, packages.roots))
    raise InputError(
        f"{file}: {name}: must be an existing file inside {folders}; "
        f"add its folder to the robot's packages"
    )


def _named(file: Path, package: str) -> list[Path]:
    """Return the folders above a file that bear the name of a package."""
    return [folder for folder in file.parents if package and folder.name == package]
