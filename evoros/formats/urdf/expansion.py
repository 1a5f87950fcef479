"""Reads robot descriptions: xacro is expanded in a process of its own, XML is parsed strictly."""

import contextlib
import json
import logging
import math
import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from lxml.etree import _Element as Element

from evoros.base import resources as assets
from evoros.base.errors import InputError
from evoros.formats.strict_xml import fault, parse
from evoros.formats.urdf import xacro_child

_LOG = logging.getLogger(__name__)
_MESH_SCHEMES = ("package://", "model://", "file://")


def read(
    name: str,
    arguments: Mapping[str, object],
    packages: Sequence[str] = (),
    time_limit_s: float = 10.0,
) -> tuple[Path, Element]:
    """The file and the root element of a URDF, or of what a xacro file expands to.

    ``packages`` are the folders, besides the file's own package and the bundled robots, in which
    ``$(find name)``, ``package://`` and ``model://`` look. ``time_limit_s`` [s of processor time]
    bounds the expansion. Files that the description names are absolute paths in the result.

    Raises:
        InputError: the file is missing, not well-formed, does not expand, has a document type,
            or names or includes a file that is missing or outside these folders.
    """
    file = assets.find_file(name, "robots")
    root = parse(_content(file), str(file))
    roots = _roots(file, packages)
    if file.suffix == ".xacro" or "http://www.ros.org/wiki/xacro" in root.nsmap.values():
        text = expand(file, arguments, roots, time_limit_s)
        root = parse(text.encode(), f"{file} (expanded)")  # the lines are not those of the file
    elif arguments:
        raise InputError(
            f"{file}: a plain URDF takes no arguments, not {sorted(arguments)}; "
            f"remove them or name a .xacro file"
        )
    _resolve_files(root, file, roots)
    return file, root


def expand(
    file: Path, arguments: Mapping[str, object], roots: Sequence[Path], time_limit_s: float
) -> str:
    """The text that a xacro file expands to.

    Raises:
        InputError: it does not expand within the limits, or does not know an argument.
    """
    given = {name: _argument(file, name, value) for name, value in arguments.items()}
    request = {
        "file": str(file),
        "arguments": given,
        "roots": [str(root) for root in roots],
        "path": [folder for folder in sys.path if folder],  # not the folder of the file
        "seconds": math.ceil(time_limit_s),
    }
    answer = _answer(request, file, time_limit_s)
    if "error" in answer:
        where = f"{answer['file']}:{answer['line']}" if answer.get("line") else answer["file"]
        raise InputError(
            f"{where}: xacro must expand without error, but: {answer['error']}; correct the file"
        )
    unknown = sorted(set(given) - set(answer["known"]))
    if unknown:
        raise InputError(
            f"{file}: arguments must be declared by <xacro:arg>, not {', '.join(unknown)}; "
            f"it knows {', '.join(answer['known']) or 'none'}"
        )
    return str(answer["text"])


def _answer(request: dict[str, object], file: Path, time_limit_s: float) -> dict[str, str]:
    """What the child process says, which has no more than the request, and no environment."""
    rule = f"xacro must expand within {time_limit_s:g} s and {xacro_child.MEMORY_BYTES >> 20} MiB"
    cure = "look for an endless or huge expression, include or macro"
    try:
        status, output, notes = _child(json.dumps(request), file.parent, 3 * time_limit_s)
    except subprocess.TimeoutExpired as error:
        raise InputError(f"{file}: {rule}, which it does not; {cure}") from error
    notes = " ".join(notes.split())
    if status != 0:
        raise InputError(
            f"{file}: {rule}, but it ended with status {status} {notes[-200:]}; {cure}"
        )
    if notes:
        _LOG.warning("%s: xacro says: %s", file, notes)
    answer: dict[str, str] = json.loads(output)
    return answer


def _child(request: str, folder: Path, patience_s: float) -> tuple[int, str, str]:
    """Status, output and notes of the child process, which may share the processor with others.

    Where it gives up, it ends what the child has started too: that would hold the pipes open.
    """
    with subprocess.Popen(
        [sys.executable, "-I", xacro_child.__file__],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        encoding="utf-8",
        env={"LC_ALL": "C.UTF-8"},
        cwd=folder,
        start_new_session=True,
    ) as child:
        try:
            output, notes = child.communicate(request, timeout=patience_s)
        except BaseException:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(child.pid, signal.SIGKILL)
            raise
        return child.returncode, output, notes


def _argument(file: Path, name: str, value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str | int | float):
        return str(value)
    raise InputError(f"{file}: argument {name}: must be a number, a text or a flag, not {value!r}")


def _content(file: Path) -> bytes:
    try:
        return file.read_bytes()
    except OSError as error:
        raise InputError(f"{file}: must be readable, but: {error.strerror}; permit it") from error


def _roots(file: Path, packages: Sequence[str]) -> list[Path]:
    """The file's folder, the ROS package around it, the declared and the bundled folders."""
    roots = [file.parent]
    roots += [folder for folder in file.parents if (folder / "package.xml").is_file()][:1]
    for name in packages:
        folder = Path(name).expanduser()
        if not folder.is_dir():
            raise InputError(f"packages: {name}: no such folder; give an existing one")
        roots.append(folder.resolve())
    return [*roots, assets.bundled_folder("robots")]


def _resolve_files(root: Element, file: Path, roots: Sequence[Path]) -> None:
    for element in root.iter("mesh", "texture"):
        name = element.get("filename")
        if not name:
            raise fault(element, "must have a filename", "add it")
        element.set("filename", str(_inside(name, file, roots)))


def _inside(name: str, file: Path, roots: Sequence[Path]) -> Path:
    """The real path of a named file, which must lie in one of ``roots``."""
    scheme = next((s for s in _MESH_SCHEMES if name.startswith(s)), "")
    rest = name[len(scheme) :]
    if "://" in rest:
        raise InputError(f"{file}: {name}: files must be local; use {', '.join(_MESH_SCHEMES)}")
    if scheme in ("package://", "model://"):
        package, _, inner = rest.partition("/")
        named = [root for root in roots if root.name == package]
        candidates = [root / inner for root in named] + [root / rest for root in roots]
    else:
        candidates = [file.parent / rest]
    for candidate in candidates:
        real = candidate.resolve()
        if real.is_file() and any(real.is_relative_to(root.resolve()) for root in roots):
            return real
    raise InputError(
        f"{file}: {name}: must be an existing file inside {', '.join(map(str, roots))}; "
        f"add its folder to the robot's packages"
    )
