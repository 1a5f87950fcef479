"""Expands one xacro file, as a program of its own that ``expansion`` starts.

Reads a request (JSON) from standard input and answers in JSON on standard output. A xacro file
is code: its expressions reach Python. The limits set here, and the empty environment that the
parent gives, keep a faulty file from harming the run; they do not make a hostile file safe.
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
    """The given arguments, which notices the names that the file asks for."""

    def __init__(self, given: dict[str, str]) -> None:
        super().__init__(given)
        self.known: set[str] = set()

    def __contains__(self, name: object) -> bool:
        self.known.add(str(name))
        return super().__contains__(name)

    def __getitem__(self, name: str) -> str:
        self.known.add(name)
        return super().__getitem__(name)


class _OutsideError(Exception):
    """A file is named that lies in no declared folder."""


def _limit(seconds: int) -> None:
    limits = {
        resource.RLIMIT_CPU: seconds,
        resource.RLIMIT_AS: MEMORY_BYTES,
        resource.RLIMIT_FSIZE: 0,
        resource.RLIMIT_CORE: 0,
    }
    for kind, value in limits.items():
        given = resource.getrlimit(kind)[1]
        least = value if given == resource.RLIM_INFINITY else min(value, given)
        with contextlib.suppress(ValueError, OSError):  # not every system has every limit
            resource.setrlimit(kind, (least, least))


def _package(name: str, roots: list[str]) -> str:
    """The folder of a ROS package: a root of that name, or a folder of that name in a root."""
    for root in map(Path, roots):
        if root.name == name:
            return str(root)
        if (root / name).is_dir():
            return str(root / name)
    raise LookupError(f"package {name!r} is in none of the folders {', '.join(roots)}")


def _open(name: str, roots: list[str]) -> TextIO:
    """What a file includes or loads (YAML), like its meshes, must lie in a declared folder."""
    real = Path(name).resolve()
    if not any(real.is_relative_to(Path(root).resolve()) for root in roots):
        raise _OutsideError(f"{name} must lie inside {', '.join(roots)} or the robot's packages")
    return real.open()


def _expand(file: str, given: dict[str, str], roots: list[str]) -> dict[str, Any]:
    import xacro  # type: ignore[import-untyped, unused-ignore]
    from xacro import substitution_args

    read = xacro.parse

    def parse(text: Any, filename: str | None = None) -> Any:
        document = read(text, filename)
        if document.doctype is not None:
            raise ValueError("a document type (<!DOCTYPE>) is not allowed")
        return document

    def find(name: str) -> str:
        return _package(name, roots)

    xacro.parse = parse
    xacro.open = lambda name: _open(name, roots)  # xacro opens every file by this name
    substitution_args._eval_find = find
    substitution_args._eval_dict["find"] = find
    arguments = _Arguments(given)
    try:
        document = xacro.process_file(file, mappings=arguments)
    except RecursionError:
        return {"error": "it includes or calls itself without end", "file": file}
    except _OutsideError as error:
        return {"error": str(error), "file": file}
    except MemoryError:
        return {"error": f"it needs more than {MEMORY_BYTES >> 20} MiB", "file": file}
    except Exception as error:  # whatever the expressions of the file raise
        where = (xacro.filestack or [file])[-1] or file
        line = getattr(error, "lineno", None)
        return {"error": " ".join(str(error).split()), "file": where, "line": line}
    text = document.toprettyxml(indent="  ")
    if len(text) > OUTPUT_CHARACTERS:
        return {"error": f"it expands to more than {OUTPUT_CHARACTERS >> 20} MiB", "file": file}
    return {"text": text, "known": sorted(arguments.known)}


def main() -> None:
    """Answer the one request."""
    request = json.load(sys.stdin)
    sys.path[:] = request["path"]
    _limit(request["seconds"])
    answer, sys.stdout = sys.stdout, sys.stderr  # a file that prints must not spoil the answer
    json.dump(_expand(request["file"], request["arguments"], request["roots"]), answer)


if __name__ == "__main__":
    main()
