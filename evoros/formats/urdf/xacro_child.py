"""Expands one xacro file, as a separate program that ``expansion`` starts.

The program reads a request (JSON) from standard input and answers in JSON on standard output. A
xacro file is code, because its expressions reach Python. The limits set here and the empty
environment that the parent passes keep a faulty file from harming the run; they do not make a
hostile file safe.
"""

import contextlib
import io
import json
import os
import re
import resource
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, BinaryIO

MEMORY_BYTES = 1 << 30
OUTPUT_CHARACTERS = 1 << 24
NAMESPACE = r"ros\.org/(wiki/)?xacro"  # in every address that xacro has had
_IGNORED = "/ignored-package"  # where $(find) says that an ignored package is


class _Arguments(dict[str, str]):
    """The arguments of the request, which record the names that the file asks for."""

    def __init__(self, arguments: dict[str, str]) -> None:
        super().__init__(arguments)
        self.known: set[str] = set()

    def __contains__(self, name: object) -> bool:
        self.known.add(str(name))
        return super().__contains__(name)

    def __getitem__(self, name: str) -> str:
        self.known.add(name)
        return super().__getitem__(name)


class _OutsideError(Exception):
    """The file names a file that lies in no declared folder."""


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
        with contextlib.suppress(ValueError, OSError):  # not every system has every limit
            resource.setrlimit(kind, (allowed, allowed))


class _Packages:
    """The packages of the request, and what is left out because of those to be ignored."""

    def __init__(self, request: dict[str, Any]) -> None:
        self.roots: list[str] = request["roots"]
        self.folders: dict[str, str] = request["packages"]
        self.ignored: list[str] = request["ignored"]
        self.skipped: list[str] = []  # includes and macros
        self.missing: dict[str, str] = {}  # packages of includes, with the file that includes

    def find(self, name: str) -> str:
        """Return the folder of a package: a root of that name, or a folder of that name in one."""
        if name in self.ignored:
            return f"{_IGNORED}/{name}"
        for root in map(Path, self.roots):
            if root.name == name:
                return str(root)
            if (root / name).is_dir():
                return str(root / name)
        if name not in self.folders:
            raise LookupError(self.explain([name]))
        return self.folders[name]

    def explain(self, names: Sequence[str]) -> str:
        """Return the error for packages that are missing."""
        return (
            f"package {', '.join(names)} is in none of the folders {', '.join(self.roots)}, nor in "
            f"ROS_PACKAGE_PATH, AMENT_PREFIX_PATH or the folders around the file; add the folder "
            f"that holds it to the robot's packages, or its name to ignored_packages if only an "
            f"accessory needs it"
        )

    def find_included(self, name: str, file: str) -> str:
        """Return the folder of an included package; a missing one is left out, to report all."""
        try:
            return self.find(name)
        except LookupError:
            self.missing.setdefault(name, file)
            return f"{_IGNORED}/{name}"

    def open(self, name: str) -> BinaryIO:
        """Open an included or loaded file, which must lie in a declared folder, like meshes."""
        real = Path(name).resolve()
        allowed = [*self.roots, *self.folders.values()]
        if not any(real.is_relative_to(Path(root).resolve()) for root in allowed):
            folders = ", ".join(self.roots)
            raise _OutsideError(f"{name} must lie inside {folders} or the robot's packages")
        return io.BytesIO(_start_with_declaration(real.read_bytes()))


def _start_with_declaration(content: bytes) -> bytes:
    """Return the content of a file without comments or blank lines before its declaration."""
    return re.sub(rb"\A(\s|<!--.*?-->)+(?=<\?xml )", b"", content, flags=re.DOTALL)


def _patch_xacro(packages: _Packages, environment: dict[str, str]) -> Any:
    """Import xacro, restricted to allowed files without a document type."""
    import xacro  # type: ignore[import-untyped, unused-ignore]
    from xacro import substitution_args

    os.environ.update(environment)
    original_parse, original_extension = xacro.parse, xacro.eval_extension

    def parse(text: Any, filename: str | None = None) -> Any:
        document = original_parse(text, filename)
        if document.doctype is not None:
            raise ValueError("a document type (<!DOCTYPE>) is not allowed")
        _rename_prefix(document.documentElement)
        return document

    def read_variable(name: str) -> str:
        if name not in os.environ:
            raise LookupError(
                f"$(env {name}) must have a value; set {name} in the robot's environment"
            )
        return os.environ[name]

    xacro.parse = parse
    xacro.open = packages.open  # xacro opens every file by this name
    xacro.eval_extension = lambda text: original_extension(
        text.replace("$(find-pkg-share ", "$(find ")  # as launch files of ROS 2 write it
    )
    substitution_args._eval_env = read_variable
    for name, function in (("find", packages.find), ("env", read_variable)):
        setattr(substitution_args, f"_eval_{name}", function)
        substitution_args._eval_dict[name] = function
    _skip_ignored(xacro, packages)
    return xacro


def _skip_ignored(xacro: Any, packages: _Packages) -> None:
    """Make xacro leave out includes from ignored packages, and calls of their macros."""
    process_include, handle_macro_call = xacro.process_include, xacro.handle_macro_call

    def include(node: Any, macros: Any, symbols: Any, func: Any) -> None:
        for package in re.findall(
            r"\$\(find(?:-pkg-share)? ([^)$\s]+)\)", node.getAttribute("filename")
        ):
            folder = packages.find_included(package, xacro.filestack[-1])
            packages.folders.setdefault(package, folder)
        name = str(xacro.eval_text(node.getAttribute("filename"), symbols))
        if name.removeprefix("file://").startswith(_IGNORED):
            packages.skipped.append(name.removeprefix("file://").removeprefix(_IGNORED + "/"))
            xacro.replace_node(node, by=None)
        else:
            node.setAttribute("filename", name.removeprefix("file://"))
            process_include(node, macros, symbols, func)

    def call_macro(node: Any, macros: Any, symbols: Any) -> bool:
        if packages.skipped and node.tagName.startswith("xacro:") and node.tagName != "xacro:call":
            try:
                xacro.resolve_macro(node.tagName[len("xacro:") :], macros, symbols)
            except KeyError:
                packages.skipped.append(f"<{node.tagName}>")
                xacro.replace_node(node, by=None)
                return True
        return bool(handle_macro_call(node, macros, symbols))

    xacro.process_include, xacro.handle_macro_call = include, call_macro


def _rename_prefix(root: Any) -> None:
    """Write ``xacro:`` where a file binds another prefix to xacro, since xacro knows no other."""
    prefixes = [
        name.partition(":")[2]
        for name, value in root.attributes.items()
        if name.startswith("xmlns:") and name != "xmlns:xacro" and re.search(NAMESPACE, value)
    ]
    for element in root.getElementsByTagName("*") if prefixes else ():
        prefix, _, tag = element.tagName.partition(":")
        if tag and prefix in prefixes:
            element.tagName = element.nodeName = f"xacro:{tag}"


def _expand(request: dict[str, Any]) -> dict[str, Any]:
    file, packages = request["file"], _Packages(request)
    xacro = _patch_xacro(packages, request["environment"])
    mappings = _Arguments(request["arguments"])
    try:
        document = xacro.process_file(file, mappings=mappings)
    except RecursionError:
        return {"error": "it includes or calls itself endlessly", "file": file}
    except _OutsideError as error:
        return {"error": str(error), "file": file}
    except MemoryError:
        return {"error": f"it needs more than {MEMORY_BYTES >> 20} MiB", "file": file}
    except Exception as error:  # the expressions of the file may raise anything
        current = (xacro.filestack or [file])[-1] or file
        reason = " ".join(str(error).split())
        line = getattr(error, "lineno", None) or _find_line(current, str(error))
        return {"error": reason, "file": current, "line": line}
    if packages.missing:
        first = next(iter(packages.missing.values()))
        return {"error": packages.explain(list(packages.missing)), "file": first}
    text = document.toprettyxml(indent="  ")
    if len(text) > OUTPUT_CHARACTERS:
        return {"error": f"it expands to more than {OUTPUT_CHARACTERS >> 20} MiB", "file": file}
    return {"text": text, "known": sorted(mappings.known), "skipped": packages.skipped}


def _find_line(file: str, error: str) -> int | None:
    """Return the line of the expression or macro that an error of xacro quotes, if there is one."""
    quoted = re.search(r"when evaluating expression '(.*)'|unknown macro name: (\S+)", error)
    if quoted is None:
        return None
    text = quoted[1] or f"<{quoted[2]}"
    try:
        lines = Path(file).read_text().splitlines()
    except (OSError, UnicodeDecodeError):
        return None
    return next((number for number, line in enumerate(lines, 1) if text in line), None)


def main() -> None:
    """Answer the request on standard input."""
    request = json.load(sys.stdin)
    sys.path[:] = request["path"]
    _limit_resources(request["seconds"])
    answer, sys.stdout = sys.stdout, sys.stderr  # a file that prints must not spoil the answer
    json.dump(_expand(request), answer)


if __name__ == "__main__":
    main()
