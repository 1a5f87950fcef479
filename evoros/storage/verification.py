"""Verifies run folders; raises InputError for missing, damaged and unreadable files."""

from collections.abc import Container, Mapping
from pathlib import Path
from typing import Any

from evoros.base.errors import InputError
from evoros.files.disk import require_no_links
from evoros.formats.sdf.writer import require_closed
from evoros.storage import digests, layout
from evoros.storage.run_key import is_foreign, read_key

NEEDED = "generations/"  # folder of the generations' tables, which are all required
LARGE = (  # files that only some figures require
    f"{layout.TRAJECTORIES}/",
    *("champion/agents/", "champion/robot", "champion/trajectory_", "champion/world_"),
)


def verify_folder(folder: Path) -> None:
    """Check that a folder contains no links, and that its tables and inputs are undamaged."""
    require_no_links(folder)
    manifest, status = (
        layout.read_sealed(folder, name) if (folder / name).is_file() else {}
        for name in (layout.MANIFEST, layout.STATUS)
    )
    entries = _read_entries(folder)
    digests.require_origin(folder, manifest, entries.by_name)
    if is_foreign(status, manifest):
        raise layout.damaged(folder, layout.STATUS, f" (it is {digests.FOREIGN})")
    if not _has_generations(entries.by_name, status):
        raise layout.damaged(folder, layout.DIGESTS, " (the table of a generation is not listed)")
    for name in entries.by_name:
        if name.startswith(NEEDED) or (not name.startswith(LARGE) and (folder / name).is_file()):
            _verify(folder, name, entries)


def is_complete(folder: Path) -> bool:
    """Return True if a finished folder has all files for figures, listed in ``digests.csv``."""
    entries = _read_entries(folder).by_name
    places = [p for n in ("champion", layout.TRAJECTORIES) for p in (folder / n).rglob("[!.]*")]
    written = {str(path.relative_to(folder)) for path in places if path.is_file()}
    needed = [name for name in entries if not name.startswith(LARGE)]
    return (
        has_all_digests(folder, layout.read_json(folder / layout.STATUS))
        and written <= entries.keys()
        and all((folder / name).is_file() for name in needed)
    )


def has_all_digests(folder: Path, status: Mapping[str, Any]) -> bool:
    """Return True if ``digests.csv`` of a finished folder is complete and sorted."""
    content = layout.read_bytes(folder / layout.DIGESTS)
    entries = digests.read_entries(content).by_name
    ordered = digests.write_entries({name: entries[name] for name in sorted(entries)})
    return (
        content == ordered.encode()
        and {layout.CONFIG, layout.MISSIONS, layout.SETTING} <= entries.keys()
        and _has_generations(entries, status)
    )


def _has_generations(entries: Mapping[str, digests.Entry], status: Mapping[str, Any]) -> bool:
    return sum(name.startswith(NEEDED) for name in entries) >= (status.get("generations_done") or 0)


def list_tables(folder: Path) -> list[Path]:
    """List the tables of generations that the run has written, in order."""
    names = _read_entries(folder).by_name
    return [folder / name for name in sorted(names) if name.startswith(NEEDED)]


def list_strays(folder: Path) -> list[Path]:
    """List the tables of generations that the run has not written."""
    files = find_strays(folder, ())  # before reading digests, which a running process adds
    written = _read_entries(folder).by_name
    return [file for file in files if str(file.relative_to(folder)) not in written]


def find_strays(folder: Path, written: Container[str]) -> list[Path]:
    """Find tables of generations, such as ``00002 (1).csv``, whose names are not ``written``."""
    files = sorted((folder / NEEDED).glob("[!.]*"))
    return [file for file in files if str(file.relative_to(folder)) not in written]


def verify_file(folder: Path, name: str) -> None:
    """Check that a file listed in ``digests.csv`` is undamaged or missing."""
    entries = _read_entries(folder)
    if name in entries.by_name and (folder / name).is_file():
        _verify(folder, name, entries)


def verify_world(path: Path) -> None:
    """Check that the SDF file of a world, and the files it refers to, are undamaged."""
    folder = _find_folder(path)
    begin = str(path.relative_to(folder).with_suffix(""))
    for name in _read_entries(folder).by_name:
        if name.startswith(begin):
            verify_file(folder, name)
    require_closed(path)


def read_text(path: Path) -> str:
    """Verify and read a file in a folder."""
    try:
        folder = _find_folder(path)
        verify_file(folder, str(path.relative_to(folder)))
        return layout.read_bytes(path).decode()
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: cannot be read ({error}); restore the file") from error


def _find_folder(path: Path) -> Path:
    for parent in path.parents:
        if (parent / layout.DIGESTS).is_file():
            return parent
    raise InputError(f"{path}: its run folder has no {layout.DIGESTS}; restore that file")


def _read_entries(folder: Path) -> digests.Entries:
    entries = digests.read_entries(layout.read_bytes(folder / layout.DIGESTS))
    if entries.damaged:
        raise layout.damaged(folder, layout.DIGESTS, f": line {entries.damaged[0]}")
    return entries


def _verify(folder: Path, name: str, entries: digests.Entries) -> None:
    entry = entries.by_name[name]
    line = _find_damage(folder, name, entry)
    if line is None:
        return
    now = _read_entries(folder)  # a running process may have replaced the file
    if now.by_name.get(name) == entry:
        raise layout.damaged(folder, name, line)
    _verify(folder, name, now)


def _find_damage(folder: Path, name: str, entry: digests.Entry) -> str | None:
    """Return the location of damage, such as ``: line 7`` or ""; None if undamaged."""
    if entry.sha256 and layout.hash_file(folder / name) == entry.sha256:
        return None
    content = layout.read_bytes(folder / name)
    key = read_key(layout.read_json(folder / layout.MANIFEST))
    row = _find_row(content, entry, key) if name == layout.MISSIONS else ""
    if not entry.sha256:
        return row or None
    return row or digests.find_line(content, entry)


def _find_row(content: bytes, entry: digests.Entry, key: bytes) -> str:
    """Return the first damaged, repeated or foreign line of ``missions.csv``."""
    header, *lines = layout.split_lines(content) or [b""]
    if entry.lines and digests.find_line(header, entry):
        return ": line 1"
    known = set[bytes]()
    for line_number, line in enumerate(lines, 2):
        if line in known or (not layout.is_sealed(line, key) and layout.is_damaged(line, key)):
            return f": line {line_number}"
        known.add(line)
    return ""
