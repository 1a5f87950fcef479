"""The files from which a folder follows. Both the manifest and ``digests.csv`` have their hashes.

If two of the three agree and the other does not, that one was changed, or is of another run.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from evoros.base.errors import InputError
from evoros.storage.digests import Entry, find_line, is_whole, read_entries
from evoros.storage.file_reading import damaged, hash_file, read_bytes
from evoros.storage.layout import CONFIG, DIGESTS, MANIFEST, ORIGINALS, resume_command

FOREIGN = "of another run"
_HASHES = {CONFIG: "configuration"}
"""Names of hashes in the manifest that are not those of their files."""


def find_foreign(
    folder: Path, manifest: Mapping[str, Any], entries: Mapping[str, Entry]
) -> str | None:
    """Return which of the manifest and the digests is of another run; None if neither is."""
    hashes = manifest.get("sha256", {})
    for name in ORIGINALS:
        entry, recorded = entries.get(name), hashes.get(_HASHES.get(name, name))
        if entry is None or recorded in (None, entry.sha256) or not (folder / name).is_file():
            continue
        actual = hash_file(folder / name)
        if actual in (entry.sha256, recorded):
            return MANIFEST if actual == entry.sha256 else DIGESTS
    return None


def require_origin(folder: Path, manifest: Mapping[str, Any], entries: Mapping[str, Entry]) -> None:
    """Require that the manifest and the digests of a folder are of its run.

    Raises:
        InputError: one of them is of another run.
    """
    foreign = find_foreign(folder, manifest, entries)
    if foreign is None:
        return
    others = f"the other files agree with {MANIFEST if foreign == DIGESTS else DIGESTS}"
    fix = "restore it from a copy; the rest of the folder is kept"
    if foreign == DIGESTS:
        fix = f"restore it or type: {resume_command(folder)}"
    raise InputError(f"{folder / foreign}: must be of this run, and is {FOREIGN} ({others}); {fix}")


def read_original(folder: Path, name: str, manifest: Mapping[str, Any]) -> bytes:
    """Read a file that cannot be made again and has no seal.

    Raises:
        InputError: it is damaged, or the ``manifest`` is of another run.
    """
    content = read_bytes(folder / name)
    known = read_bytes(folder / DIGESTS) if (folder / DIGESTS).is_file() else b""
    entries = read_entries(known).by_name
    foreign = find_foreign(folder, manifest, entries)
    if foreign == MANIFEST:
        require_origin(folder, manifest, entries)
    entry = entries.get(name)  # without it, the hash in the manifest decides
    if entry is not None and foreign is None and not is_whole(content, entry):
        raise damaged(folder, name, find_line(content, entry))
    return content
