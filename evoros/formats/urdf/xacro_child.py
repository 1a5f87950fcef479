"""Expands one xacro file, as a separate program that ``expansion`` starts.

The program reads a request (JSON) from standard input and answers in JSON on standard output. A
xacro file is code, because its expressions reach Python. The limits set here and the empty
environment that the parent passes keep a faulty file from harming the run; they do not make a
hostile file safe.
"""

import contextlib
import json
import resource
import sys
from pathlib import Path
from typing import Any, TextIO

MEMORY_BYTES = 1 << 30
OUTPUT_CHARACTERS = 1 << 24


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


def _find_package(name: str, roots: list[str]) -> str:
    """Return the folder of a ROS package: a root of that name, or a folder of that name in one."""
    for root in map(Path, roots):
        if root.name == name:
            return str(root)
        if (root / name).is_dir():
            return str(root / name)
    raise LookupError(f"package {name!r} is in none of the folders {', '.join(roots)}")


def _open(name: str, roots: list[str]) -> TextIO:
    """Open an included or loaded file, which must lie in a declared folder, like meshes."""
    real = Path(name).resolve()
    if not any(real.is_relative_to(Path(root).resolve()) for root in roots):
        raise _OutsideError(f"{name} must lie inside {', '.join(roots)} or the robot's packages")
    return real.open()


def _patch_xacro(roots: list[str]) -> Any:
    """Import xacro, restricted to files in ``roots`` without a document type."""
    import xacro  # type: ignore[import-untyped, unused-ignore]
    from xacro import substitution_args

    original_parse = xacro.parse

    def parse(text: Any, filename: str | None = None) -> Any:
        document = original_parse(text, filename)
        if document.doctype is not None:
            raise ValueError("a document type (<!DOCTYPE>) is not allowed")
        return document

    def find(name: str) -> str:
        return _find_package(name, roots)

    xacro.parse = parse
    xacro.open = lambda name: _open(name, roots)  # xacro opens every file by this name
    substitution_args._eval_find = find
    substitution_args._eval_dict["find"] = find
    return xacro


def _expand(file: str, arguments: dict[str, str], roots: list[str]) -> dict[str, Any]:
    xacro = _patch_xacro(roots)
    mappings = _Arguments(arguments)
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
        line = getattr(error, "lineno", None)
        return {"error": " ".join(str(error).split()), "file": current, "line": line}
    text = document.toprettyxml(indent="  ")
    if len(text) > OUTPUT_CHARACTERS:
        return {"error": f"it expands to more than {OUTPUT_CHARACTERS >> 20} MiB", "file": file}
    return {"text": text, "known": sorted(mappings.known)}


def main() -> None:
    """Answer the request on standard input."""
    request = json.load(sys.stdin)
    sys.path[:] = request["path"]
    _limit_resources(request["seconds"])
    answer, sys.stdout = sys.stdout, sys.stderr  # a file that prints must not spoil the answer
    json.dump(_expand(request["file"], request["arguments"], request["roots"]), answer)


if __name__ == "__main__":
    main()
