"""Run folders: file names, digests inside files, types of sealed fields, reading.

Digests in table rows, which include the run's key, and in JSON files reveal damage. A last row
without a newline was truncated by a kill or a power failure.
"""

import csv
import io
import json
import os
import re
from base64 import b32encode
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from hashlib import blake2b
from pathlib import Path
from typing import Any

from evoros.base.checks import Rule, is_real, is_whole
from evoros.base.errors import InputError, explain_path, shell_line
from evoros.files.disk import LARGE, SMALL, hash_regular, read_regular
from evoros.files.nested import parse_json

DIGEST = "digest"  # last column of a sealed table, and last field of a sealed JSON file
SIZE = 16  # length of a digest [characters]
_BLANK = b"-" * SIZE


def compute_digest(content: bytes, key: bytes = b"") -> str:
    """Return 80 bits of BLAKE2b as 16 characters that no program reads as a number."""
    return b32encode(blake2b(content, digest_size=10, key=key).digest()).decode()


def split_lines(content: bytes) -> list[bytes]:
    """Return the lines, split only at newlines, with line breaks."""
    return io.BytesIO(content).readlines()


def seal_rows(text: str, key: bytes = b"") -> bytes:
    """Return CSV rows with a digest appended to each row as the last cell."""
    lines = (line.encode() for line in text.split("\n")[:-1])
    return b"".join(b"%b,%b\n" % (line, compute_digest(line, key).encode()) for line in lines)


def is_sealed(line: bytes, key: bytes = b"") -> bool:
    """Return True if a line, including its newline, ends with the digest of its other cells."""
    if not line.endswith(b"\n"):
        return False
    row, _, digest = line[:-1].rpartition(b",")
    return digest == compute_digest(row, key).encode()


def is_damaged(line: bytes, key: bytes = b"") -> bool:
    """Return True if an unsealed line is damaged, not just the truncated end of a table."""
    return line.endswith(b"\n") or is_sealed(line[:-1] + b"\n", key)


def seal_json(name: str, content: Mapping[str, Any]) -> str:
    """Return a JSON object whose last field is a digest of its other fields and ``name``."""
    text = json.dumps({**content, DIGEST: _BLANK.decode()}, indent=2) + "\n"
    head, _, tail = text.rpartition(_BLANK.decode())
    return f"{head}{compute_digest(text.encode(), name.encode())}{tail}"


def unseal_json(name: str, content: bytes, others: Iterable[str] = ()) -> dict[str, Any]:
    """Return the object in a sealed JSON file, without digest; raise ValueError if damaged."""
    fields = parse_json(content)
    begin = content.rfind(b'"digest": "') + len(b'"digest": "')
    blank = content[:begin] + _BLANK + content[begin + SIZE :]
    digest = content[begin : begin + SIZE].decode(errors="replace")
    if digest != compute_digest(blank, name.encode()):
        copied = (other for other in others if digest == compute_digest(blank, other.encode()))
        problem = next((f"it is a {other}" for other in copied), "its digest does not match")
        raise ValueError(problem)
    if not isinstance(fields, dict):
        raise ValueError("it is not a JSON object")
    return {name: value for name, value in fields.items() if name != DIGEST}


FORMAT_VERSION = 1
RUN, EVALUATE = "evoros", "evoros evaluate"  # commands for a search and for given designs
CONFIG, MANIFEST, STATUS, MISSIONS = "config.yaml", "manifest.json", "status.json", "missions.csv"
DESIGN_FILE, GENE_FILE = "designs_in.csv", "genes_in.csv"  # an evaluation's given designs
ORIGINALS = (CONFIG, DESIGN_FILE, GENE_FILE)  # these files, with the manifest, determine all others
ROBOT_AS_LOADED = "robot_as_loaded.urdf"  # description loaded by engines, if not ``robot.urdf``
SELF_SIGHT = "self_sight.csv"  # the champion's sensors that see the robot
RUNNING, FINISHED, STOPPED = "running", "finished", "stopped"  # states in ``status.json``
LOG, LOST = "evoros.log", "lost"
SETTING = "setting.json"
DIGESTS = "digests.csv"
TRAJECTORIES = "trajectories"
CONTROLS, EVALUATION = "controls", "evaluation"  # folder of a run's controls; evaluation in it
SCORES, WORST_CASES = "designs.csv", "worst_cases.csv"
REQUIREMENTS, JUNIT, SUMMARY = "requirements.csv", "junit.xml", "requirements.md"
DAMAGED = "damaged"  # folder for copies of damaged files that resuming has repaired
# Fields of the manifest:
OVERRIDES = "overrides"  # typed by the user
CONFIG_DIR = "config_dir"  # the user's configuration folder; null if there is none
SECRETS = "secrets"  # digests of potentially secret values, by dotted key
SWEEP = "sweep"  # sweep folder of the run; null for a single run
COLUMNS = "columns"  # columns of ``missions.csv`` without the digest
AGENTS = "agents"  # names of all robots but the first


def resume_command(path: Path, config_dir: str | None = None, typed: Sequence[str] = ()) -> str:
    """Return the command that resumes a run, by default with its configuration folder."""
    return shell_line("evoros", "resume", str(path), *typed, *name_parts(path, config_dir))


def name_parts(path: Path, config_dir: str | None = None) -> tuple[str, ...]:
    """Return the option for a run's configuration folder; empty if it has none."""
    folder = config_dir or read_json(path / MANIFEST).get(CONFIG_DIR)
    return ("--config-dir", str(folder)) if folder else ()


def replay_command(path: Path, columns: Mapping[Any, object], option: Sequence[str]) -> str:
    """Return the command that replays a mission; ``option`` comes from ``name_parts``."""
    values = [f"{name}={value}" for name, value in columns.items()]
    return shell_line("evoros", "replay", str(path), *values, *option)


def advise_finish(path: Path) -> str:
    """Return advice on finishing a run; the state of a killed run may still be RUNNING."""
    if read_json(path / STATUS).get("state") == RUNNING:
        status = shell_line("evoros", "status", str(path))
        return f"wait until it ends; to see its state, type: {status}"
    return f"type: {resume_command(path)}"


def evaluates(path: Path) -> bool:
    """Return True if a folder holds an evaluation, False if a search."""
    return str(read_json(path / MANIFEST).get("command", RUN)) == EVALUATE


def read_json(path: Path) -> dict[str, Any]:
    """Read the object in a sealed JSON file; empty if missing or damaged."""
    try:
        return unseal(path.name, read_regular(path, SMALL))
    except (OSError, ValueError):
        return {}


_TEXT = Rule("a string", lambda v: isinstance(v, str))
_TEXT_OR_NULL = Rule("a string or null", lambda v: isinstance(v, str | None))
_FLAG_OR_NULL = Rule("true, false or null", lambda v: isinstance(v, bool | None))
_WHOLE = Rule("an integer", is_whole)
_NUMBER_OR_NULL = Rule("a number or null", lambda v: v is None or is_real(v))
_TEXTS = Rule("a list of strings", lambda v: isinstance(v, list) and all(map(_TEXT.holds, v)))
_OBJECT = Rule("an object", lambda v: isinstance(v, dict))
_OBJECT_OF_TEXTS = Rule(
    "an object with strings",
    lambda v: isinstance(v, dict) and all(map(_TEXT_OR_NULL.holds, v.values())),
)
_MANIFEST = {
    **dict.fromkeys(("format_version", "seed"), _WHOLE),
    **dict.fromkeys(("command", "created", "working_directory", "record"), _TEXT),
    **dict.fromkeys(
        ("commit", "config_dir", "sweep", "python", "platform", "operating_system", "processor"),
        _TEXT_OR_NULL,
    ),
    **dict.fromkeys((AGENTS, "simulators", OVERRIDES, COLUMNS), _TEXTS),
    **dict.fromkeys(("packages", "programs", "sha256", SECRETS), _OBJECT_OF_TEXTS),
    "choices": _OBJECT,
    "dirty": _FLAG_OR_NULL,
}
_NUMBERS = Rule("a list of numbers", lambda v: isinstance(v, list) and all(map(is_real, v)))
_STATUS = {**dict.fromkeys(("state", "reason", "run", "updated"), _TEXT), "processor_s": _NUMBERS}
"""Rules for the fields of ``status.json``; other fields are numbers or null."""


def unseal(name: str, content: bytes) -> dict[str, Any]:
    """Return the fields of a sealed file; raise ValueError for damage or a wrong type."""
    fields = unseal_json(name, content, (MANIFEST, STATUS))
    kinds, other = (_MANIFEST, None) if name == MANIFEST else (_STATUS, _NUMBER_OR_NULL)
    for key, value in fields.items():
        kind = kinds.get(key, other)
        if kind is not None and not kind.holds(value):
            raise ValueError(f"{key} must be {kind.text}, not {value!r:.40}")
    return fields


MARKS = ("config.yaml", "manifest.json", "missions.csv")
"""Files that mark a run folder, even if it is damaged; one is enough."""


def folders_below(path: Path, skip: Callable[[str], object]) -> Iterator[Path]:
    """Yield the run folders at or below ``path``, in natural order of names."""

    def explain(error: OSError) -> None:
        if explanation := explain_path(error):
            skip(explanation)

    for parent, folders, files in os.walk(path, onerror=explain):
        folders[:] = sorted((f for f in folders if not f.startswith(".")), key=natural_key)
        if any(name in files for name in MARKS):
            folders.clear()
            yield Path(parent)


def natural_key(name: str) -> list[tuple[int, str]]:
    """Return a sort key for natural order, which compares numbers by value."""
    return [
        (int(part or -1), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", name)
    ]


def read_bytes(path: Path, limit: int = LARGE) -> bytes:
    """Read a file in a folder without verification."""
    try:
        return read_regular(path, limit)
    except OSError as error:
        raise explain_unreadable(path, error) from error


def read_rows(path: Path) -> list[dict[str, str]]:
    """Read the rows of a table in a folder, as mappings from columns to cells."""
    return list(csv.DictReader(read_bytes(path).decode().splitlines()))


def hash_file(path: Path) -> str:
    """Return the SHA-256 of a file in a folder."""
    try:
        return hash_regular(path)
    except OSError as error:
        raise explain_unreadable(path, error) from error


def explain_unreadable(path: Path, error: OSError) -> InputError:
    """Return the error for an unreadable file in a folder."""
    if not isinstance(error, FileNotFoundError):
        return InputError(f"{path}: cannot be read ({error.strerror}); restore the file")
    folders = (folder for folder in path.parents if (folder / MANIFEST).is_file())
    return InputError(
        f"{path}: not found; the run is not finished, or the file was deleted; "
        f"{advise_finish(next(folders, path.parent))}"
    )


def read_sealed(folder: Path, name: str) -> dict[str, Any]:
    """Read a sealed JSON file in a folder."""
    try:
        return unseal(name, read_bytes(folder / name, SMALL))
    except ValueError as error:
        raise damaged(folder, name, f" ({error})") from error


def damaged(folder: Path, name: str, where: str = "") -> InputError:
    """Return the error for a damaged file in a folder."""
    fix = f"restore it or type: {resume_command(folder)}"
    if name in (MANIFEST, *ORIGINALS):
        fix = "restore it from a copy, and leave the other files as they are"
    return InputError(
        f"{folder / name}{where}: has changed since evoros wrote it (for example, a disk fault or "
        f"an edit); {fix}"
    )
