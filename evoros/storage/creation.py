"""Atomic creation of run folders."""

import errno
import os
import shutil
from collections.abc import Mapping
from pathlib import Path
from secrets import token_hex

from evoros.base.errors import InputError
from evoros.files.disk import exists, make_folder, sync, write_atomically
from evoros.storage.digests import describe_file, describe_growing, write_entries
from evoros.storage.layout import CONFIG, DIGESTS, LOG, MANIFEST, MISSIONS, resume_command


def require_unused(path: Path) -> None:
    """Check that the folder of a new run does not exist or is empty."""
    if not exists(path) or (path.is_dir() and not any(path.iterdir())):
        return
    require_whole(path)
    if any((path / name).exists() for name in (CONFIG, MANIFEST, MISSIONS)):
        raise InputError(
            f"{path}: already contains a run, and runs are never overwritten; "
            f"to continue this run, type: {resume_command(path)}"
        )
    raise InputError(f"{path}: must be a new or empty folder; choose another with hydra.run.dir")


def require_whole(path: Path) -> None:
    """Raise an error if a kill left a configuration without a mission table or a log."""
    begun = any((path / name).exists() for name in (MISSIONS, LOG))
    if (path / CONFIG).exists() and not begun:
        raise InputError(
            f"{path}: has {CONFIG} but no {MISSIONS}, because the run was killed before the first "
            f"mission; delete the contents of the folder and start again"
        )


def create_folder(path: Path, files: Mapping[str, str]) -> None:
    """Create a folder, or fill an empty one, with ``files``, CONFIG first and MISSIONS last.

    DIGESTS covers all files except the sealed manifest. A new folder is created atomically; in an
    existing folder (such as a mount point), the last file marks completion.
    """
    try:
        _create_folder(path.resolve(), _add_digests(files))  # follows a symbolic link
    except OSError as error:
        require_unused(path)  # another process may have created the folder
        full = error.errno in (errno.ENOSPC, errno.EDQUOT)
        fix = "free some space there" if full else "choose another with hydra.run.dir"
        raise InputError(f"{path}: cannot be created ({error.strerror}); {fix}") from error


def _add_digests(files: Mapping[str, str]) -> dict[str, str]:
    *others, last = files
    entries = {name: describe_file(files[name].encode()) for name in others if name != MANIFEST}
    entries[last] = describe_growing(files[last].encode())
    first = {name: files[name] for name in others}
    return {**first, DIGESTS: write_entries(entries), last: files[last]}


def _create_folder(path: Path, files: Mapping[str, str]) -> None:
    if path.exists():
        _fill(path, files)
        return
    make_folder(path.parent)
    # mkdtemp would ignore the umask and create a private folder
    draft = path.with_name(f".{path.name}.{token_hex(4)}")
    draft.mkdir()
    try:
        _fill(draft, files)
        draft.replace(path)
        sync(path.parent)
    except BaseException:
        shutil.rmtree(draft, ignore_errors=True)
        raise


def _fill(path: Path, files: Mapping[str, str]) -> None:
    (first, content), *others = files.items()
    with (path / first).open("x", encoding="utf-8") as file:  # fails if another process was faster
        try:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
            sync(path)
            for name, text in others:
                write_atomically(path / name, text)
        except BaseException:
            for name in reversed(list(files)):
                (path / name).unlink(missing_ok=True)
            raise
