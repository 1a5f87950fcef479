"""Folders that a subcommand writes as a whole, and replaces only if nobody has changed them."""

import hashlib
import json
import os
import shutil
from collections.abc import Mapping
from pathlib import Path

from evoros.base.errors import InputError

RECORD = "evoros.json"
"""The file in such a folder that has the hash of each other file."""


def write_folder(path: Path, command: str, files: Mapping[str, bytes]) -> None:
    """Write files, by their paths in a folder, which appears complete or not at all.

    Raises:
        InputError: the folder exists with other content than the same command wrote into it.
        OSError: it cannot be written.
    """
    _check_unchanged(path, command)
    path.parent.mkdir(parents=True, exist_ok=True)
    draft, replaced = (
        path.with_name(f".{path.name}.{os.getpid()}.{kind}") for kind in ("new", "old")
    )
    hashes = {name: hashlib.sha256(content).hexdigest() for name, content in files.items()}
    record = json.dumps({"command": command, "sha256": hashes}, indent=1) + "\n"
    try:
        for name, content in {**files, RECORD: record.encode()}.items():
            (draft / name).parent.mkdir(parents=True, exist_ok=True)
            (draft / name).write_bytes(content)
        if path.exists():
            path.rename(replaced)
        draft.rename(path)
        shutil.rmtree(replaced, ignore_errors=True)
    finally:
        shutil.rmtree(draft, ignore_errors=True)
        if replaced.exists() and not path.exists():
            replaced.rename(path)


def _check_unchanged(path: Path, command: str) -> None:
    """Check that a folder is empty, absent, or as the command wrote it."""
    if not path.exists() and not path.is_symlink():
        return
    problem = _find_change(path, command)
    if problem:
        raise InputError(
            f"{path}: must be new, or as {command} wrote it, to be replaced, but {problem}; "
            f"move it away, or choose another --output"
        )


def _find_change(path: Path, command: str) -> str:
    """Return what in a folder is not of the command, or nothing."""
    if not path.is_dir() or path.is_symlink():
        return "it is no folder"
    present = {
        str(file.relative_to(path)): file for file in sorted(path.rglob("*")) if not file.is_dir()
    }
    if not present:
        return ""
    try:
        record = json.loads((path / RECORD).read_text(encoding="utf-8"))
        known = dict(record["sha256"]) if record["command"] == command else {}
    except (OSError, ValueError, TypeError, KeyError):
        known = {}
    if not known:
        return f"it has no {RECORD} of that command"
    for name, file in present.items():
        if name != RECORD and name not in known:
            return f"{name} was added"
        if name != RECORD and hashlib.sha256(file.read_bytes()).hexdigest() != known[name]:
            return f"{name} was changed"
    missing = next((name for name in known if name not in present), "")
    return f"{missing} was deleted" if missing else ""
