"""Reads robot descriptions: expands xacro in a separate process, parses XML strictly."""

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

from evoros.base.errors import InputError
from evoros.base.resources import bundled_folder, find_file
from evoros.formats.strict_xml import element_error, parse
from evoros.formats.urdf import xacro_child

_LOG = logging.getLogger(__name__)
_MESH_SCHEMES = ("package://", "model://", "file://")


def read(
    name: str,
    arguments: Mapping[str, object],
    packages: Sequence[str] = (),
    time_limit_s: float = 10.0,
) -> tuple[Path, Element]:
    """Return the file and the root element of a URDF, or of the expansion of a xacro file.

    ``packages`` are folders in which ``$(find name)``, ``package://`` and ``model://`` look, in
    addition to the file's own package and the bundled robots. ``time_limit_s`` [s of processor
    time] bounds the expansion. In the result, all names of files are absolute paths.

    Raises:
        InputError: the file is missing, not well-formed, cannot be expanded, has a DOCTYPE, or
            names a file that is missing or outside of these folders.
    """
    file = find_file(name, "robots")
    root = parse(_read_content(file), str(file))
    roots = _find_roots(file, packages)
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
    """Return the text that a xacro file expands to.

    Raises:
        InputError: the file cannot be expanded within the limits, or does not know an argument.
    """
    texts = {name: _format_argument(file, name, value) for name, value in arguments.items()}
    request = {
        "file": str(file),
        "arguments": texts,
        "roots": [str(root) for root in roots],
        "path": [folder for folder in sys.path if folder],  # not the folder of the file
        "seconds": math.ceil(time_limit_s),
    }
    answer = _request_expansion(request, file, time_limit_s)
    if "error" in answer:
        place = f"{answer['file']}:{answer['line']}" if answer.get("line") else answer["file"]
        raise InputError(
            f"{place}: xacro must expand without error, but: {answer['error']}; correct the file"
        )
    unknown = sorted(set(texts) - set(answer["known"]))
    if unknown:
        raise InputError(
            f"{file}: arguments must be declared by <xacro:arg>, not {', '.join(unknown)}; "
            f"it knows {', '.join(answer['known']) or 'none'}"
        )
    return str(answer["text"])


def _request_expansion(
    request: dict[str, object], file: Path, time_limit_s: float
) -> dict[str, str]:
    """Return the answer of the child process, which gets only the request and no environment."""
    rule = f"xacro must expand within {time_limit_s:g} s and {xacro_child.MEMORY_BYTES >> 20} MiB"
    fix = "look for an endless or huge expression, include or macro"
    try:
        status, output, messages = _run_child(json.dumps(request), file.parent, 3 * time_limit_s)
    except subprocess.TimeoutExpired as error:
        raise InputError(f"{file}: {rule}, but it did not; {fix}") from error
    messages = " ".join(messages.split())
    if status != 0:
        raise InputError(
            f"{file}: {rule}, but it ended with status {status} {messages[-200:]}; {fix}"
        )
    if messages:
        _LOG.warning("%s: xacro reports: %s", file, messages)
    answer: dict[str, str] = json.loads(output)
    return answer


def _run_child(request: str, folder: Path, patience_s: float) -> tuple[int, str, str]:
    """Run the child process and return its status, output and messages.

    The child may share the processor with others, so ``patience_s`` [s] exceeds its time limit. On
    a timeout, all processes that it has started end too, since they would hold the pipes open.
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
            output, messages = child.communicate(request, timeout=patience_s)
        except BaseException:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(child.pid, signal.SIGKILL)
            raise
        return child.returncode, output, messages


def _format_argument(file: Path, name: str, value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str | int | float):
        return str(value)
    raise InputError(
        f"{file}: argument {name}: must be a number, a text, true or false, not {value!r}; "
        f"set it to such a value"
    )


def _read_content(file: Path) -> bytes:
    try:
        return file.read_bytes()
    except OSError as error:
        raise InputError(
            f"{file}: must be readable, but: {error.strerror}; change its permissions"
        ) from error


def _find_roots(file: Path, packages: Sequence[str]) -> list[Path]:
    """Return the file's folder, the ROS package around it, the declared and the bundled folders."""
    roots = [file.parent]
    roots += [folder for folder in file.parents if (folder / "package.xml").is_file()][:1]
    for name in packages:
        folder = Path(name).expanduser()
        if not folder.is_dir():
            raise InputError(f"packages: {name}: no such folder; give an existing one")
        roots.append(folder.resolve())
    return [*roots, bundled_folder("robots")]


def _resolve_files(root: Element, file: Path, roots: Sequence[Path]) -> None:
    """Replace the names of meshes and textures by absolute paths."""
    for element in root.iter("mesh", "texture"):
        name = element.get("filename")
        if not name:
            raise element_error(element, "must have a filename", "add it")
        element.set("filename", str(_resolve(name, file, roots)))


def _resolve(name: str, file: Path, roots: Sequence[Path]) -> Path:
    """Return the real path of a named file, which must lie in one of ``roots``."""
    scheme = next((s for s in _MESH_SCHEMES if name.startswith(s)), "")
    path = name[len(scheme) :]
    if "://" in path:
        raise InputError(f"{file}: {name}: files must be local; use {', '.join(_MESH_SCHEMES)}")
    if scheme in ("package://", "model://"):
        package, _, inner = path.partition("/")
        named = [root for root in roots if root.name == package]
        candidates = [root / inner for root in named] + [root / path for root in roots]
    else:
        candidates = [file.parent / path]
    for candidate in candidates:
        real = candidate.resolve()
        if real.is_file() and any(real.is_relative_to(root.resolve()) for root in roots):
            return real
    raise InputError(
        f"{file}: {name}: must be an existing file inside {', '.join(map(str, roots))}; "
        f"add its folder to the robot's packages"
    )
