"""Reads robot descriptions: expands xacro in a separate process, parses XML strictly."""

import contextlib
import json
import logging
import math
import os
import re
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

from lxml.etree import _Element as Element

from evoros.base.errors import InputError
from evoros.base.resources import find_file
from evoros.formats.lenient_xml import parse_leniently
from evoros.formats.strict_xml import parse
from evoros.formats.urdf import xacro_child
from evoros.formats.urdf.named_files import resolve_files
from evoros.formats.urdf.packages import PackageIndex, index_packages

_LOG = logging.getLogger(__name__)
_XACRO = re.compile(xacro_child.NAMESPACE)
_PLACEHOLDER = re.compile(r"\$\{(\w+)\}")
_WITHOUT_LINKS = ("material", "gazebo", "transmission")
_PREFIX = re.compile(r"(robot_?)?(namespace|ns|prefix)|tf_prefix")


@dataclass(frozen=True)
class ReadOptions:
    """How to read a description: what xacro gets, and where named files may be."""

    arguments: Mapping[str, object] = field(default_factory=dict)  # of the xacro file
    packages: Sequence[str] = ()  # folders that are packages or hold some
    ignored_packages: Sequence[str] = ()  # what comes from them is left out
    environment: Mapping[str, object] = field(default_factory=dict)  # for $(env) and $(optenv)
    time_limit_s: float = 10.0  # of processor time


def read(name: str, options: ReadOptions | None = None) -> tuple[Path, Element]:
    """Return the file and the root element of a URDF, or of the expansion of a xacro file.

    In the result, the names of existing files are addresses (``file:///...``). A mesh that is
    missing keeps its name, and whoever needs it reports it.

    Raises:
        InputError: the file is missing, not well-formed, cannot be expanded, has a DOCTYPE, or
            names a file outside of the folders that it may read.
    """
    options = options or ReadOptions()
    file = find_file(name, "robots")
    content = _read_content(file)
    root = parse_leniently(content, str(file))
    packages = index_packages(file, options.packages, options.ignored_packages)
    if file.suffix == ".xacro" or any(map(_XACRO.search, root.nsmap.values())):
        text = expand(file, options, packages)
        root = parse_leniently(
            text.encode(), f"{file} (expanded)"
        )  # the lines are not those of the file
        if b":macro" in content:
            _check_robot(root, file)
    else:
        root = _fill_placeholders(content.decode(errors="replace"), file, options.arguments, root)
    resolve_files(root, file, packages)
    return file, root


def _check_robot(root: Element, file: Path) -> None:
    """Refuse a xacro file that only defines macros, and name the files that call them."""
    if root.tag != "robot" or any(child.tag not in _WITHOUT_LINKS for child in root):
        return
    users = [
        other.name
        for other in sorted(file.parent.rglob("*.xacro"))[:200]
        if other != file and file.name in other.read_text(errors="replace")
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
    found = sorted(set(_PLACEHOLDER.findall(text)))
    unknown = sorted(set(arguments) - set(found))
    if unknown:
        knows = f"the placeholders {', '.join(found)}" if found else "no arguments"
        raise InputError(
            f"{file}: a plain URDF with {knows} takes no argument {', '.join(unknown)}; "
            f"remove it or name a .xacro file"
        )
    if not found:
        return root
    values = {name: "" for name in found if _PREFIX.fullmatch(name)}
    values |= {name: _format_argument(file, name, value) for name, value in arguments.items()}
    lacking = [name for name in found if name not in values]
    if lacking:
        raise InputError(
            f"{file}: ${{{lacking[0]}}} must have a value, because the file has placeholders but "
            f"does not declare xacro; set robot.arguments.{lacking[0]}"
        )
    empty = [name for name in found if not values[name]]
    if empty:
        _LOG.warning("%s: the placeholders %s are left empty", file, ", ".join(empty))
    filled = _PLACEHOLDER.sub(lambda match: escape(values[match[1]]), text)
    return parse(filled.encode(), str(file))


def expand(file: Path, options: ReadOptions, packages: PackageIndex) -> str:
    """Return the text that a xacro file expands to.

    Raises:
        InputError: the file cannot be expanded within the limits, or does not know an argument.
    """
    texts, variables = (
        {name: _format_argument(file, name, value) for name, value in values.items()}
        for values in (options.arguments, options.environment)
    )
    request = {
        "file": str(file),
        "arguments": texts,
        "environment": variables,
        "roots": [str(root) for root in packages.roots],
        "packages": {name: str(folder) for name, folder in packages.folders.items()},
        "ignored": sorted(packages.ignored),
        "path": [folder for folder in sys.path if folder],  # not the folder of the file
        "seconds": math.ceil(options.time_limit_s),
    }
    answer = _request_expansion(request, file, options.time_limit_s)
    if "error" in answer:
        place = f"{answer['file']}:{answer['line']}" if answer.get("line") else answer["file"]
        lacking = re.search(r"Undefined substitution argument (\w+)", answer["error"])
        fix = f"set robot.arguments.{lacking[1]}" if lacking else "correct the file"
        raise InputError(f"{place}: xacro must expand without error, but: {answer['error']}; {fix}")
    unknown = sorted(set(texts) - set(answer["known"]))
    if unknown:
        raise InputError(
            f"{file}: arguments must be declared by <xacro:arg>, not {', '.join(unknown)}; "
            f"it knows {', '.join(answer['known']) or 'none'}"
        )
    if answer["skipped"]:
        left_out = ", ".join(dict.fromkeys(answer["skipped"]))
        _LOG.warning("%s: of ignored packages, left out: %s", file, left_out)
    return str(answer["text"])


def _request_expansion(
    request: dict[str, object], file: Path, time_limit_s: float
) -> dict[str, Any]:
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
    answer: dict[str, Any] = json.loads(output)
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
