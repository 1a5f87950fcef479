"""Creates the folder of a run or an evaluation, which appears whole or not at all."""

import os
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path

from evoros.base.errors import InputError
from evoros.files.disk import make_folder, sync, write_atomically
from evoros.storage.digests import describe_file, describe_growing, write_entries
from evoros.storage.layout import CONFIG, DIGESTS, LOG, MANIFEST, MISSIONS, resume_command


def require_unused(path: Path) -> None:
    """Require that a folder for a new run does not exist or is empty."""
    if not path.exists() or (path.is_dir() and not any(path.iterdir())):
        return
    require_whole(path)
    if any((path / name).exists() for name in (CONFIG, MANIFEST, MISSIONS)):
        raise InputError(
            f"{path}: this folder already holds a run, and a run is never overwritten; "
            f"to continue it type: {resume_command(path)}"
        )
    raise InputError(
        f"{path}: a run needs a new or an empty folder; choose another with hydra.run.dir"
    )


def require_whole(path: Path) -> None:
    """Require that the creation of a folder was finished, which its mission table or log shows.

    Raises:
        InputError: the process was killed while it created the folder.
    """
    begun = any((path / name).exists() for name in (MISSIONS, LOG))
    if (path / CONFIG).exists() and not begun:
        raise InputError(
            f"{path}: must be a whole run or empty: it has {CONFIG} and no {MISSIONS}, so its run "
            f"was killed before its first mission; delete what is in the folder and start again"
        )


def create_folder(path: Path, files: Mapping[str, str]) -> None:
    """Create a folder with these files, or fill an empty one; first CONFIG, last MISSIONS.

    All but the manifest, which has a digest of its own, get their digests in DIGESTS.

    A new folder is created atomically. An existing one is not replaced, because it may be a mount
    point or somebody's current folder; there the last file marks that the creation is finished.

    Raises:
        InputError: the folder cannot be created; nothing was changed.
    """
    try:
        _create_folder(path.resolve(), _add_digests(files))  # the target of a link
    except OSError as error:
        raise InputError(
            f"{path}: the folder of the run cannot be made ({error.strerror}); choose another "
            f"with hydra.run.dir"
        ) from error


def _add_digests(files: Mapping[str, str]) -> dict[str, str]:
    """Return the files with DIGESTS before the last."""
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
    draft = Path(tempfile.mkdtemp(prefix=f".{path.name}.", dir=path.parent))
    try:
        draft.chmod(0o755)
        _fill(draft, files)
        draft.replace(path)
        sync(path.parent)
    except BaseException:
        shutil.rmtree(draft, ignore_errors=True)
        raise


def _fill(path: Path, files: Mapping[str, str]) -> None:
    """Write the first files into an empty folder, and remove them again if one fails."""
    (first, content), *others = files.items()
    with (path / first).open("x", encoding="utf-8") as file:  # refuses one of two processes
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
