"""A program that expands one xacro file; ``xacro_expansion`` starts it.

The program reads a request (JSON) from standard input and writes the answer (JSON) to standard
output. A xacro file is code, because its expressions can run Python. Resource limits and an
environment without the user's variables protect the run from faulty files, but not from hostile
ones. Up to ROS Indigo (2014), xacro's tags and macro calls required no prefix, and properties and
macros could be used before their definitions; such files are converted.
"""

import contextlib
import functools
import json
import os
import re
import resource
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

LEGACY_TAGS = {
    "arg": ("name", "default"),
    "if": ("value",),
    "include": ("filename",),
    "insert_block": ("name",),
    "macro": ("name",),
    "property": ("name",),
    "unless": ("value",),
}
"""Tags of xacro, with the attributes that distinguish them from SDF tags of the same name."""
_DEFINITIONS = ("xacro:property", "xacro:macro", "xacro:include")
_URDF = (
    *("robot", "link", "joint", "material", "origin", "parent", "child", "axis", "limit", "mimic"),
    *("calibration", "dynamics", "safety_controller", "inertial", "mass", "inertia", "visual"),
    *("collision", "geometry", "box", "cylinder", "sphere", "capsule", "mesh", "color", "texture"),
    *("contact", "verbose"),
)
_FOREIGN = ("gazebo", "transmission", "ros2_control", "sensor")
"""Elements whose children are neither URDF nor xacro."""


def add_prefixes(root: Any) -> Iterator[str]:
    """Add ``xacro:`` to each tag in ``LEGACY_TAGS`` with the listed attributes; yield the tags."""
    for tag, attributes in LEGACY_TAGS.items():
        for element in root.getElementsByTagName(tag):
            if all(map(element.hasAttribute, attributes)):
                rename(element, tag)
                yield tag


def rename(element: Any, tag: str) -> None:
    """Give an element a xacro tag."""
    element.tagName = element.nodeName = f"xacro:{tag}"


def move_definitions(root: Any) -> None:
    """Move properties, macros and includes, in this order, before all other elements."""
    elements = [child for child in root.childNodes if child.nodeType == child.ELEMENT_NODE]
    moved = [e for tag in _DEFINITIONS for e in elements if e.tagName == tag]
    for element in reversed(moved):
        root.removeChild(element)
        root.insertBefore(element, root.firstChild)


def calls_macro(element: Any, macros: Any) -> bool:
    """Return True if an element without a prefix can only be a macro call."""
    if element.tagName in _URDF or element.tagName not in macros:
        return False
    above = element.parentNode
    while above is not None and above.nodeType == above.ELEMENT_NODE:
        if above.tagName in _FOREIGN:
            return False
        above = above.parentNode
    document = element.ownerDocument.documentElement
    return bool(document is not None and document.tagName == "robot")


MEMORY_BYTES = 1 << 30
OUTPUT_CHARACTERS = 1 << 24
NAMESPACE = r"ros\.org/(wiki/)?xacro"  # part of every address used for xacro


class _Arguments(dict[str, str]):
    """The arguments of a request, which record the names requested by the file."""

    def __init__(self, arguments: dict[str, str]) -> None:
        super().__init__(arguments)
        self.known: set[str] = set()

    def __contains__(self, name: object) -> bool:
        self.known.add(str(name))
        return super().__contains__(name)

    def __getitem__(self, name: str) -> str:
        self.known.add(name)
        return super().__getitem__(name)


def _limit_resources(seconds: int) -> None:
    limits = {
        resource.RLIMIT_CPU: seconds,
        resource.RLIMIT_AS: MEMORY_BYTES,
        resource.RLIMIT_FSIZE: 0,
        resource.RLIMIT_CORE: 0,
    }
    for kind, limit in limits.items():
        hard = resource.getrlimit(kind)[1]
        allowed = limit if hard == resource.RLIM_INFINITY else min(limit, hard)
        with contextlib.suppress(ValueError, OSError):  # some systems lack some limits
            resource.setrlimit(kind, (allowed, allowed))


def _patch_xacro(packages: Any, request: dict[str, Any]) -> Any:
    """Import xacro, restrict it to allowed files without DOCTYPE, and make it accept old tags."""
    import xacro  # type: ignore[import-untyped, unused-ignore]
    from xacro import substitution_args

    os.environ.update(request["environment"])
    original_parse, original_extension = xacro.parse, xacro.eval_extension

    def parse(text: Any, filename: str | None = None) -> Any:
        document = original_parse(text, filename)
        if document.doctype is not None:
            raise ValueError("a document type (<!DOCTYPE>) is not allowed")
        _rename_prefix(document.documentElement)
        packages.legacy += add_prefixes(document.documentElement)
        if request["definitions_first"]:
            move_definitions(document.documentElement)
        return document

    def read_variable(name: str) -> str:
        if name not in os.environ:
            fix = f"set {name} in the robot's environment"
            raise LookupError(f"$(env {name}) must have a value; {fix}")
        return os.environ[name]

    xacro.parse = parse
    xacro.open = packages.open  # xacro calls its global ``open`` for every file
    xacro.eval_extension = lambda text: original_extension(
        text.replace("$(find-pkg-share ", "$(find ")  # syntax of ROS 2 launch files
    )

    def find(name: str) -> str:
        return str(packages.find(name, xacro.filestack[-1]))

    # xacro looks up packages in ROS unless $(find ...) is replaced, and $(env ...) must name the
    # key to set. Replacing these functions is xacro's only hook, and is safe because this process
    # runs nothing else.
    for name, function in (("find", find), ("env", read_variable)):
        setattr(substitution_args, f"_eval_{name}", function)
        substitution_args._eval_dict[name] = function
    _skip_absent(xacro, packages)
    return xacro


def _skip_absent(xacro: Any, packages: Any) -> None:
    """Make xacro skip files of ignored or missing packages, and calls to their macros."""
    process_include, handle_macro_call = xacro.process_include, xacro.handle_macro_call

    def include(node: Any, macros: Any, symbols: Any, func: Any) -> None:
        evaluate = functools.partial(xacro.eval_text, symbols=symbols)
        name = packages.include(node, xacro.filestack[-1], evaluate)
        if name:
            node.setAttribute("filename", name)
            process_include(node, macros, symbols, func)
        else:
            xacro.replace_node(node, by=None)

    def call_macro(node: Any, macros: Any, symbols: Any) -> bool:
        if calls_macro(node, macros):
            packages.legacy.append(node.tagName)
            rename(node, node.tagName)
        left_out = packages.skipped or packages.files
        if left_out and node.tagName.startswith("xacro:") and node.tagName != "xacro:call":
            try:
                xacro.resolve_macro(node.tagName[len("xacro:") :], macros, symbols)
            except KeyError:
                packages.skipped.append(f"<{node.tagName}>")
                xacro.replace_node(node, by=None)
                return True
        return bool(handle_macro_call(node, macros, symbols))

    xacro.process_include, xacro.handle_macro_call = include, call_macro


def _rename_prefix(root: Any) -> None:
    """Rename a different prefix bound to xacro to ``xacro:``, the only prefix it accepts."""

    prefixes = [
        name.partition(":")[2]
        for name, value in root.attributes.items()
        if name.startswith("xmlns:") and name != "xmlns:xacro" and re.search(NAMESPACE, value)
    ]
    for element in root.getElementsByTagName("*") if prefixes else ():
        prefix, _, tag = element.tagName.partition(":")
        if tag and prefix in prefixes:
            rename(element, tag)


def _expand(request: dict[str, Any]) -> dict[str, Any]:
    from evoros.formats.urdf.packages import PackageIndex
    from evoros.formats.urdf.xacro_packages import OutsideError, Packages

    file = request["file"]
    roots = tuple(map(Path, request["roots"]))
    folders = {name: Path(folder) for name, folder in request["packages"].items()}
    packages = Packages(PackageIndex(roots, folders, frozenset(request["ignored"])))
    xacro = _patch_xacro(packages, request)
    mappings = _Arguments(request["arguments"])
    absent = {"packages": packages.absent, "files": packages.files}
    try:
        document = xacro.process_file(file, mappings=mappings)
    except RecursionError:
        return {"error": "it includes or calls itself endlessly", "file": file}
    except OutsideError as error:
        return {"error": str(error), "file": file, "absent": absent}
    except MemoryError:
        return {"error": f"it needs more than {MEMORY_BYTES >> 20} MiB", "file": file}
    except Exception as error:  # expressions of the file may raise any exception
        current = (xacro.filestack or [file])[-1] or file
        reason = " ".join(str(error).split())
        line = getattr(error, "lineno", None) or _find_line(current, str(error))
        return {"error": reason, "file": current, "line": line, "absent": absent}
    text = document.toprettyxml(indent="  ")
    if len(text) > OUTPUT_CHARACTERS:
        return {"error": f"it expands to more than {OUTPUT_CHARACTERS >> 20} MiB", "file": file}
    return {
        "text": text,
        "known": sorted(mappings.known),
        "skipped": packages.skipped,
        "unlike": packages.unlike,
        "legacy": packages.legacy,
        "absent": absent,
        "read": packages.read,
    }


def _find_line(file: str, error: str) -> int | None:
    quoted = re.search(r"when evaluating expression '(.*)'|unknown macro name: (\S+)", error)
    if quoted is None:
        return None
    text = quoted[1] or f"<{quoted[2]}"
    try:
        lines = Path(file).read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError):
        return None
    return next((i for i, line in enumerate(lines, 1) if text in line), None)


def main() -> None:
    """Answer the request on standard input."""
    request = json.load(sys.stdin)
    sys.path[:] = request["path"]
    _limit_resources(request["seconds"])
    answer, sys.stdout = sys.stdout, sys.stderr  # keeps text that the file prints out of the answer
    json.dump(_expand(request), answer)


if __name__ == "__main__":
    main()
