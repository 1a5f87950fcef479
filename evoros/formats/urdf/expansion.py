"""Reads robot descriptions: expands xacro in a separate process, parses XML strictly."""

import logging
import re
from collections.abc import Mapping
from pathlib import Path
from xml.sax.saxutils import escape

from lxml.etree import _Element as Element

from evoros.base.errors import InputError
from evoros.files.resources import find_file, read_file
from evoros.formats.lenient_xml import parse_leniently
from evoros.formats.missing import Absences
from evoros.formats.strict_xml import parse
from evoros.formats.urdf import xacro_child
from evoros.formats.urdf.named_files import EXPANDED, collect_absent_meshes, resolve_files
from evoros.formats.urdf.packages import index_packages
from evoros.formats.urdf.xacro_expansion import ReadOptions, choose_instead, expand, format_argument

_LOG = logging.getLogger(__name__)
_XACRO = re.compile(xacro_child.NAMESPACE)
_PLACEHOLDER = re.compile(r"\$\{(\w+)\}")
_WITHOUT_LINKS = ("material", "gazebo", "transmission")
_PREFIX = re.compile(r"(robot_?)?(namespace|ns|prefix)|tf_prefix")


def read(name: str, options: ReadOptions | None = None) -> tuple[Path, Element]:
    """Return the file and the root element of a URDF, or of the expansion of a xacro file.

    In the result, the names of existing files are addresses (``file:///...``). A mesh that is
    missing keeps its name: it may be one that nothing needs, or ``missing`` allows it.

    Raises:
        InputError: the file is missing, not well-formed, cannot be expanded, has a DOCTYPE, names
            a file outside of the folders that it may read, or names packages or meshes that are
            absent; the message has all of these.
    """
    options = options or ReadOptions()
    file = find_file(name, "robots")
    content = read_file(file)
    root = parse_leniently(content, str(file))
    packages = index_packages(file, options.packages, options.ignored_packages)
    absences = Absences(str(file))
    if file.suffix == ".xacro" or any(map(_XACRO.search, root.nsmap.values())):
        text, absences = expand(file, options, packages)
        root = parse_leniently(text.encode(), f"{file}{EXPANDED}")
        if b":macro" in content and not absences.names():
            _check_robot(root, file)
    else:
        root = _fill_placeholders(content.decode(errors="replace"), file, options.arguments, root)
    resolve_files(root, file, packages)
    if options.missing == "error":
        collect_absent_meshes(root, absences, packages)
    absences.require_none(choose_instead(absences, options))
    return file, root


def _check_robot(root: Element, file: Path) -> None:
    """Refuse a xacro file that only defines macros, and name the files that call them."""
    if root.tag != "robot" or any(child.tag not in _WITHOUT_LINKS for child in root):
        return
    users = [
        other.name
        for other in sorted(file.parent.rglob("*.xacro"))[:200]
        if other != file and file.name in other.read_text(encoding="utf-8", errors="replace")
    ]
    named = f", for example {', '.join(users[:3])}" if users else ""
    raise InputError(
        f"{file}: must describe a robot, but expands to no <link>: it only defines macros; name "
        f"the file that calls them{named}"
    )


def _fill_placeholders(
    text: str, file: Path, arguments: Mapping[str, object], root: Element
) -> Element:
    """Return the root with ``${NAME}`` replaced, as launch files do in a URDF without xacro.

    Prefixes of names are empty unless an argument gives them.
    """
    names = sorted(set(_PLACEHOLDER.findall(text)))
    unknown = sorted(set(arguments) - set(names))
    if unknown:
        knows = f"the placeholders {', '.join(names)}" if names else "no arguments"
        raise InputError(
            f"{file}: a plain URDF with {knows} takes no argument {', '.join(unknown)}; "
            f"remove it or name a .xacro file"
        )
    if not names:
        return root
    values = {name: "" for name in names if _PREFIX.fullmatch(name)}
    values |= {name: format_argument(file, name, value) for name, value in arguments.items()}
    lacking = [name for name in names if name not in values]
    if lacking:
        raise InputError(
            f"{file}: ${{{lacking[0]}}} must have a value, because the file has placeholders but "
            f"does not declare xacro; set robot.arguments.{lacking[0]}"
        )
    empty = [name for name in names if not values[name]]
    if empty:
        _LOG.warning("%s: the placeholders %s are left empty", file, ", ".join(empty))
    filled = _PLACEHOLDER.sub(lambda match: escape(values[match[1]]), text)
    return parse(filled.encode(), str(file))
