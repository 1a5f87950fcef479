"""Expands xacro files in a separate process."""

import contextlib
import json
import logging
import math
import os
import re
import shlex
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from evoros.base.errors import InputError
from evoros.files.reads import note_read
from evoros.files.resources import PACKAGE
from evoros.formats.missing import Absence, Absences, Remedy
from evoros.formats.urdf import xacro_child
from evoros.formats.urdf.accessories import is_needed
from evoros.formats.urdf.packages import PackageIndex
from evoros.formats.urdf.xacro_packages import IGNORED

_LOG = logging.getLogger(__name__)
_UNDEFINED = re.compile(r"is not defined|unknown macro name|Undefined block")
"""Matches errors in files from before 2014, when xacro read all definitions first."""

_ALIKE = 0.7  # minimum similarity of names that may denote the same file


@dataclass(frozen=True)
class ReadOptions:
    """Options for reading a description: xacro's input, and folders of named files."""

    arguments: Mapping[str, object] = field(default_factory=dict)  # xacro arguments
    packages: Sequence[str] = ()  # folders that are or contain packages
    ignored_packages: Sequence[str] = ()  # packages whose files are left out
    environment: Mapping[str, object] = field(default_factory=dict)  # $(env) and $(optenv)
    missing: str = "error"  # treatment of missing meshes: error, leave_out or box
    packages_key: str = "robot.packages"  # configuration key of ``packages``, for messages
    time_limit_s: float = 10.0  # processor time


def expand(file: Path, options: ReadOptions, packages: PackageIndex) -> tuple[str, Absences]:
    """Return the XML of an expanded xacro file, and the packages and files that it lacks."""
    texts, variables = (
        {name: format_argument(file, name, value) for name, value in values.items()}
        for values in (options.arguments, options.environment)
    )
    request = {
        "file": str(file),
        "arguments": texts,
        "environment": variables,
        "roots": [str(root) for root in packages.roots],
        "packages": {name: str(folder) for name, folder in packages.folders.items()},
        "ignored": sorted(packages.ignored),
        "path": [*(folder for folder in sys.path if folder), str(PACKAGE.parent)],
        "seconds": math.ceil(options.time_limit_s),
        "definitions_first": False,
    }
    answer = _request_expansion(request, file, options.time_limit_s)
    if _UNDEFINED.search(answer.get("error", "")):
        later = {**request, "definitions_first": True}
        again = _request_expansion(later, file, options.time_limit_s)
        if "error" not in again:
            note = "%s uses names before their definitions, so all definitions are read first"
            _LOG.warning(note, file)
            answer = again
    absences = _collect_absences(file, answer.get("absent", {}), options)
    if "error" in answer:
        raise InputError(_explain_error(answer, options))
    unknown = sorted(set(texts) - set(answer["known"]))
    if unknown:
        raise InputError(
            f"{file}: no <xacro:arg> declares {', '.join(unknown)}; "
            f"the arguments are {', '.join(answer['known']) or 'none'}"
        )
    note_read(answer["read"])
    _tell_skipped(file, answer)
    text, names = str(answer["text"]), absences.names()
    calls = [*dict.fromkeys(name for name in answer["skipped"] if name.startswith("<"))]  # macros
    if names and not is_needed(text, names, calls):
        note = "%s: missing items that only accessories need are left out: %s"
        _LOG.warning(note, file, ", ".join((*names, *calls)))
        return re.sub(f"(file://)?{IGNORED}/", "package://", text), Absences(str(file))
    return text, absences


def choose_instead(absences: Absences, options: ReadOptions) -> str:
    """Return the keys to set as an alternative to providing missing items."""
    if options.packages_key != ReadOptions.packages_key:  # worlds have no ignored packages
        return "delete the elements that name the missing items"
    packages = absences.names("package")
    choices = []
    if packages:
        ignored = ",".join([*options.ignored_packages, *packages])
        choices.append(
            f"type 'robot.ignored_packages=[{ignored}]' if only accessories need these packages"
        )
    if absences.names("wheel"):  # a robot requires its wheels
        choices.append("set robot.missing=box for meshes")
    elif absences.names("mesh"):
        choices.append("set robot.missing=leave_out or robot.missing=box for meshes")
    return ", or ".join(choices)


def _collect_absences(
    file: Path, absent: Mapping[str, Mapping[str, str]], options: ReadOptions
) -> Absences:
    absences = Absences(str(file))
    remedy = f"add the folder that holds {{}} to {options.packages_key}"
    for name, place in absent.get("packages", {}).items():
        sentence = f"{place}: names the package {name}, which is missing"
        absences.add(Absence("package", name, place, sentence, Remedy(remedy, name)))
    for name, place in absent.get("files", {}).items():
        sentence = f"{place}: includes {name}, which does not exist"
        absences.add(Absence("file", name, place, sentence, _find_renamed(name, place)))
    return absences


def _find_renamed(name: str, place: str) -> Remedy:
    """Suggest a fix for a missing file: a similarly named file in the folder may be meant."""
    path = Path(place.rpartition(":")[0] or place).parent / name
    files = {_stem(file): str(file) for file in path.parent.glob(f"*{path.suffix}")}
    for other in get_close_matches(_stem(path), files, 1, _ALIKE):
        command = shlex.join(["cp", files[other], str(path)])
        return Remedy("if the file was only renamed, type {}", command)
    return Remedy("correct the name {}", name)


def _stem(path: Path) -> str:
    return path.name.partition(".")[0]


def _explain_error(answer: Mapping[str, Any], options: ReadOptions) -> str:
    """Explain an error of xacro, which may result from packages and files left out."""
    place = f"{answer['file']}:{answer['line']}" if answer.get("line") else answer["file"]
    reason = str(answer["error"])
    if "; " in reason:  # the reason includes the fix
        return f"{place}: {reason}"
    argument = re.search(r"Undefined substitution argument (\w+)", reason)
    fix = f"add ++robot.arguments.{argument[1]}=VALUE" if argument else "edit the file"
    if _UNDEFINED.search(reason):
        absent = answer["absent"]
        for name, place in absent["files"].items():
            lack = f"{place} includes {name}, which does not exist but may define the name"
            fix = f"{_find_renamed(name, place)} ({lack}), or {fix}"
        names = ", ".join([*absent["packages"], *options.ignored_packages])
        if names:
            lack = f"{names} (left out, but may define the name)"
            fix = f"provide {lack} with {options.packages_key}, or {fix}"
    return f"{place}: xacro cannot expand the file: {reason}; {fix}"


def _tell_skipped(file: Path, answer: Mapping[str, Any]) -> None:
    absent = answer["absent"]["packages"]
    skipped = [name for name in answer["skipped"] if name.partition("/")[0] not in absent]
    for text, names in {
        "elements of ignored packages are left out": skipped,
        "included, although upper and lower case differ": answer["unlike"],
        "tags without the prefix xacro:, as in old files, are read as xacro tags": answer["legacy"],
    }.items():
        if names:
            _LOG.warning("%s: %s: %s", file, text, ", ".join(dict.fromkeys(names)))


def _request_expansion(
    request: dict[str, object], file: Path, time_limit_s: float
) -> dict[str, Any]:
    rule = f"xacro must finish within {time_limit_s:g} s and {xacro_child.MEMORY_BYTES >> 20} MiB"
    fix = "remove the endless or huge expression, include or macro"
    try:
        status, output, messages = _run_child(json.dumps(request), file.parent, 3 * time_limit_s)
    except subprocess.TimeoutExpired as error:
        raise InputError(f"{file}: {rule}, but exceeded a limit; {fix}") from error
    messages = " ".join(messages.split())
    if status != 0:
        end = f"exited with status {status} {messages[-200:]}"
        raise InputError(f"{file}: {rule}, but {end}; {fix}")
    if messages:
        _LOG.warning("%s: xacro reports: %s", file, messages)
    answer: dict[str, Any] = json.loads(output)
    return answer


def _run_child(request: str, folder: Path, patience_s: float) -> tuple[int, str, str]:
    """Run the child process; return its status, output and messages.

    The child may share the processor, so ``patience_s`` [s] exceeds its time limit. On a timeout,
    all its processes are ended, because they would keep the pipes open.
    """
    with subprocess.Popen(
        [sys.executable, "-I", xacro_child.__file__],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
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


def format_argument(file: Path, name: str, value: object) -> str:
    """Return an argument in xacro's notation."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str | int | float):
        return str(value)
    rule = "must be a number, a string, true or false"
    raise InputError(f"{file}: argument {name}: {rule}, not {value!r}")
