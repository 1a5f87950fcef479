"""A run folder on disk. The folder is the run: nothing is ever overwritten with other content.

Every finished mission is on disk before it is used. Resuming replays the optimizer with the
missions on disk and goes on with the first one that is missing.
"""

import csv
import fcntl
import json
import os
import shlex
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO

from evoros.errors import InputError
from evoros.mission import Mission, Place
from evoros.outcome import Outcome
from evoros.tables import MISSIONS_HEADER, mission_row, read_mission, text

FORMAT_VERSION = 1
CONFIG, MANIFEST, STATUS, MISSIONS = "config.yaml", "manifest.json", "status.json", "missions.csv"
GENERATIONS, CHAMPION, LOG = "generations", "champion", "evoros.log"


def resume_command(path: Path) -> str:
    """What to type to continue the run in the folder."""
    return f"evoros resume={shlex.quote(str(path))}"


def require_unused(path: Path) -> None:
    """A run needs a folder that does not exist or is empty.

    Raises:
        InputError: the folder holds a run, or other files.
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
    """The missions are the last of a new run's files: without them it has never begun.

    Raises:
        InputError: a kill came while the folder was made.
    """
    if (path / CONFIG).exists() and not (path / MISSIONS).exists():
        raise InputError(
            f"{path}: must be a whole run or empty: it has {CONFIG} and no {MISSIONS}, so its run "
            f"was killed before its first mission; delete what is in the folder and start again"
        )


class RunFolder:
    """An open run folder: the only writer of its files, as long as it is open.

    ``outcomes`` has every finished mission, by generation, design, world and trial.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.outcomes: dict[Place, tuple[str, Outcome]] = {}
        self._missions: BinaryIO = self._lock()
        try:
            self._read_missions()
        except BaseException:
            self._missions.close()
            raise

    @classmethod
    def create(cls, path: Path, config: str, manifest: Mapping[str, Any]) -> "RunFolder":
        """A new run in a folder that does not exist or is empty.

        Raises:
            InputError: the folder holds a run, or other files; nothing was changed.
        """
        require_unused(path)
        try:
            _draw_up(path.resolve(), config, manifest)  # of a link, what it leads to
        except OSError as error:
            raise InputError(
                f"{path}: the folder of the run cannot be made ({error.strerror}); choose another "
                f"with hydra.run.dir"
            ) from error
        return cls(path)

    def __enter__(self) -> "RunFolder":
        return self

    def __exit__(self, *_: object) -> None:
        self.sync()
        self._missions.close()

    def record(self, mission: Mission, outcome: Outcome) -> None:
        """Put a finished mission on disk. It survives the end of this process at any time."""
        self._missions.write(text([mission_row(mission, outcome)]).encode())
        self._missions.flush()
        self.outcomes[mission.place] = (mission.draws, outcome)

    def sync(self) -> None:
        """Ask the system to bring the missions to the disk itself, against a loss of power."""
        self._missions.flush()
        os.fsync(self._missions.fileno())

    def find(self, mission: Mission) -> Outcome | None:
        """The recorded outcome of the mission.

        Raises:
            InputError: it was recorded under other draws.
        """
        draws, outcome = self.outcomes.get(mission.place, ("", None))
        if outcome is not None and draws != mission.draws:
            raise InputError(
                f"{self.path / MISSIONS}: the mission {mission.place} was recorded under the draws "
                f"{draws}, not {mission.draws}: the run was made by another version or has been "
                f"edited; start a new run"
            )
        return outcome

    def write_generation(self, number: int, content: str) -> None:
        """A generation's table; a replayed one must equal what is on disk.

        Raises:
            InputError: it does not.
        """
        path = self.path / GENERATIONS / f"{number:05d}.csv"
        if path.exists() and path.read_text() != content:
            raise InputError(
                f"{path}: replaying the run gives another table than the recorded one: the run was "
                f"made by another version or has been edited; start a new run"
            )
        if not path.exists():
            write_atomically(path, content)

    def has_champion(self, files: Mapping[str, str], others: Sequence[str]) -> bool:
        """Whether the champion on disk is the one of these files, and the others are there."""
        folder = self.path / CHAMPION
        return all((folder / name).is_file() for name in others) and all(
            (folder / name).is_file() and (folder / name).read_text() == content
            for name, content in files.items()
        )

    def write_champion(self, files: Mapping[str, str]) -> None:
        """The champion's files, in place of those of an earlier end of the run.

        The last one says whose files they are: it is there only where all the others are.
        """
        folder = self.path / CHAMPION
        folder.mkdir(exist_ok=True)
        (folder / list(files)[-1]).unlink(missing_ok=True)
        for name, content in files.items():
            write_atomically(folder / name, content)

    def write_status(self, status: Mapping[str, Any]) -> None:
        """How far the run is; the one file that changes all the time."""
        write_atomically(self.path / STATUS, json.dumps(status, indent=2) + "\n")

    def read_status(self) -> dict[str, Any]:
        """The last status; empty where there is none."""
        try:
            status: dict[str, Any] = json.loads((self.path / STATUS).read_text())
        except (OSError, ValueError):
            return {}
        return status if isinstance(status, dict) else {}

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

    def _read_missions(self) -> None:
        """Read all whole rows; a last row that a kill has cut short is removed."""
        content = self._missions.read()
        whole = content[: content.rfind(b"\n") + 1]
        rows = csv.DictReader(whole.decode(errors="replace").split("\n"))
        if tuple(rows.fieldnames or ()) != MISSIONS_HEADER:
            raise InputError(
                f"{self.path / MISSIONS}: line 1: must be the columns of format {FORMAT_VERSION}; "
                f"the file is damaged or of another version; restore it, or start a new run"
            )
        for row in rows:
            try:
                place, draws, outcome = read_mission(row)
            except (KeyError, ValueError, TypeError, AttributeError) as error:
                raise InputError(
                    f"{self.path / MISSIONS}: line {rows.line_num}: must be a whole row, not a "
                    f"damaged one ({error}); delete the line, and its mission is flown again"
                ) from error
            self.outcomes[place] = (draws, outcome)
        self._missions.seek(len(whole))
        self._missions.truncate()


def _draw_up(path: Path, config: str, manifest: Mapping[str, Any]) -> None:
    """A new folder comes into being whole; in an empty one the missions come last, as the mark.

    An empty folder stays itself: it may be somebody's current folder, or a mount point.
    """
    if path.exists():
        _fill(path, config, manifest)
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = Path(tempfile.mkdtemp(prefix=f".{path.name}.", dir=path.parent))
    try:
        draft.chmod(0o755)
        _fill(draft, config, manifest)
        draft.replace(path)
    except BaseException:
        shutil.rmtree(draft, ignore_errors=True)
        raise


def _fill(path: Path, config: str, manifest: Mapping[str, Any]) -> None:
    """Write a run's first files into an empty folder; leave it empty where one cannot be."""
    with (path / CONFIG).open("x") as file:  # of two processes at the same time, one is refused
        try:
            file.write(config)
            file.flush()
            write_atomically(path / MANIFEST, json.dumps(manifest, indent=2) + "\n")
            (path / GENERATIONS).mkdir()
            write_atomically(path / MISSIONS, text([MISSIONS_HEADER]))
        except BaseException:
            shutil.rmtree(path / GENERATIONS, ignore_errors=True)
            for name in (MANIFEST, CONFIG):
                (path / name).unlink(missing_ok=True)
            raise


def write_atomically(path: Path, content: str) -> None:
    """The file has either its old content or the new one, whenever the process is killed."""
    draft = path.with_name(f".{path.name}.part")
    try:
        with draft.open("w") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())  # before the name: a loss of power must leave no empty file
        draft.replace(path)
    except BaseException:  # a full disk, Ctrl-C
        draft.unlink(missing_ok=True)
        raise
