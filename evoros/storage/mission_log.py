"""The folder of a run or an evaluation, created atomically and written by one process.

Every finished mission is on disk before its outcome is used, and no content is ever overwritten
with other content; so a run that was killed goes on with the first mission that is missing.
"""

import csv
import fcntl
import json
import os
import shlex
import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO, Self, TypeVar

from evoros.base.disk import make_folder, sync, write_atomically
from evoros.base.errors import InputError
from evoros.mission.mission import Mission
from evoros.storage.tables import to_csv

FORMAT_VERSION = 1
CONFIG, MANIFEST, STATUS, MISSIONS = "config.yaml", "manifest.json", "status.json", "missions.csv"
ROBOT_AS_LOADED = "robot_as_loaded.urdf"
"""A champion as engines load it, if that is not its ``robot.urdf``."""
LOG, LOST = "evoros.log", "lost"
Row = TypeVar("Row")


def resume_command(path: Path) -> str:
    """Return the command line that continues the run in the folder."""
    return f"{command_of(path)} resume={shlex.quote(str(path))}"


def command_of(path: Path) -> str:
    """Return the command that made the folder."""
    return str(read_json(path / MANIFEST).get("command", "evoros"))


def read_json(path: Path) -> dict[str, Any]:
    """Read the mapping in a file; empty if there is none."""
    try:
        content = json.loads(path.read_text())
    except (OSError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}


def require_unused(path: Path) -> None:
    """Require that a folder for a new run does not exist or is empty.

    Raises:
        InputError: the folder has a run, or other files.
    """
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
    """Require that the creation of a folder was finished, which its mission table shows.

    Raises:
        InputError: the process was killed while it created the folder.
    """
    if (path / CONFIG).exists() and not (path / MISSIONS).exists():
        raise InputError(
            f"{path}: must be a whole run or empty: it has {CONFIG} and no {MISSIONS}, so its run "
            f"was killed before its first mission; delete what is in the folder and start again"
        )


class MissionLog:
    """An open folder, which no other process can open for writing.

    ``header`` has the columns of the table of missions.
    """

    def __init__(self, path: Path, header: Sequence[str]) -> None:
        self.path, self._header = path, tuple(header)
        self._missions: BinaryIO = self._lock()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Release the folder to other processes."""
        self.sync()
        self._missions.close()

    def append(self, rows: Sequence[Sequence[object]]) -> None:
        """Write finished missions, which then survive a kill of this process."""
        self._missions.write(to_csv(rows).encode())
        self._missions.flush()

    def sync(self) -> None:
        """Make the system write the missions to the disk itself, against a loss of power."""
        self._missions.flush()
        os.fsync(self._missions.fileno())

    def read(self, parse: Callable[[Mapping[str, str]], Row]) -> Iterator[Row]:
        """Yield all complete rows; read to the end before appending any.

        A last row that a kill has cut short is removed. ``parse`` raises KeyError, ValueError,
        TypeError or AttributeError if a row is damaged.

        Raises:
            InputError: a row is damaged, or the columns differ.
        """
        self._missions.seek(0)
        rows = csv.DictReader(self._whole_lines())
        if tuple(rows.fieldnames or ()) != self._header:
            raise InputError(
                f"{self.path / MISSIONS}: line 1: must be the columns of format {FORMAT_VERSION}; "
                f"the file is damaged or of another version; restore it, or start a new run"
            )
        for row in rows:
            try:
                parsed = parse(row)
            except (KeyError, ValueError, TypeError, AttributeError) as error:
                raise InputError(
                    f"{self.path / MISSIONS}: line {rows.line_num}: must be a whole row, not a "
                    f"damaged one ({error}); delete the line, and its mission runs again"
                ) from error
            yield parsed

    def _whole_lines(self) -> Iterator[str]:
        end = 0
        for line in self._missions:
            if not line.endswith(b"\n"):
                break
            end += len(line)
            yield line.decode(errors="replace").rstrip("\n")
        self._missions.seek(end)
        self._missions.truncate()

    def write_once(self, name: str, content: str) -> None:
        """Write a table that follows from the missions, or compare it with the one on disk.

        Raises:
            InputError: the table on disk differs.
        """
        path = self.path / name
        if path.exists() and path.read_text() != content:
            raise InputError(
                f"{path}: replaying the run gives another table than the recorded one: the run was "
                f"made by another version or has been edited; start a new run"
            )
        if not path.exists():
            make_folder(path.parent)
            write_atomically(path, content)

    def keep_log(self, mission: Mission, log: str) -> None:
        """Write what the controller of a lost mission printed, for its user to read."""
        folder = self.path / LOST
        make_folder(folder)
        name = f"{mission.generation:05d}_{mission.design_id}_{mission.world}_{mission.trial}.log"
        write_atomically(folder / name, log)

    def write_status(self, status: Mapping[str, Any]) -> None:
        """Write the progress, the one file that is overwritten all the time."""
        write_atomically(self.path / STATUS, json.dumps(status, indent=2) + "\n")

    def read_status(self) -> dict[str, Any]:
        """Read the last status; empty if there is none."""
        return read_json(self.path / STATUS)

    def _lock(self) -> BinaryIO:
        path = self.path / MISSIONS
        require_whole(self.path)
        if not path.is_file():
            raise InputError(
                f"{self.path}: no run to resume: it has no {MISSIONS}; give the folder of a run"
            )
        missions = path.open("r+b")
        try:
            fcntl.flock(missions, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            missions.close()
            raise InputError(
                f"{self.path}: another process is running in this folder; wait for it, or end it"
            ) from error
        return missions


def create_folder(path: Path, files: Mapping[str, str]) -> None:
    """Create a folder with these files, or fill an empty one; first CONFIG, last MISSIONS.

    A new folder is created atomically. An existing one is not replaced, because it may be a mount
    point or somebody's current folder; there the last file marks that the creation is finished.

    Raises:
        InputError: the folder cannot be created; nothing was changed.
    """
    try:
        _create_folder(path.resolve(), files)  # the target of a link
    except OSError as error:
        raise InputError(
            f"{path}: the folder of the run cannot be made ({error.strerror}); choose another "
            f"with hydra.run.dir"
        ) from error


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
    with (path / first).open("x") as file:  # refuses one of two processes
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
