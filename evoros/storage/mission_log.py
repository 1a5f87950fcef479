"""The folder of a run or an evaluation, created atomically and written by one process.

Every finished mission is on disk before its outcome is used, and no content is ever overwritten
with other content; so a run that was killed goes on with the first mission that is missing.
"""

from collections.abc import Callable, Mapping, Sequence
from itertools import chain, count
from pathlib import Path
from typing import Any, Self

from evoros.base.errors import InputError
from evoros.files.disk import make_folder, require_no_links, write_atomically
from evoros.mission.mission import Mission
from evoros.storage.digests import DigestLog, Entry, describe_file, describe_growing, find_line
from evoros.storage.layout import DAMAGED, LOST, MISSIONS, SETTING, STATUS, read_json
from evoros.storage.mission_table import MissionTable
from evoros.storage.seals import seal_json
from evoros.terminal.log import LOGGER

LOST_TOO = ", repeated, or without the trajectory that belongs to it"


class MissionLog:
    """An open folder, which no other process can open for writing.

    ``header`` has the columns of the table of missions.
    """

    def __init__(self, path: Path, header: Sequence[str]) -> None:
        self.path = path
        require_no_links(path)
        self.table = MissionTable(path, header)
        self.digests = DigestLog(path)
        self._growing = describe_growing(self.table.header)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Release the folder to other processes."""
        self.table.close()

    def mend(self, setting: str, originals: Sequence[str]) -> None:
        """Remove damaged rows of missions, which run again, and write a lost ``setting`` anew.

        ``originals`` are files that the manifest has verified; their digests may be lost.
        """
        damage = self.table.damage
        if damage:
            lines = ", ".join(map(str, sorted(damage)))
            self._note_growth()
            self._set_aside(MISSIONS, b"".join(damage.values()), f": line {lines}", LOST_TOO)
            self.table.mend()
        path, content = self.path / SETTING, setting.encode()
        found = path.read_bytes() if path.is_file() else None
        if found is None:
            LOGGER.warning("%s: missing; written anew", path)
        if found is None or not self.digests.is_whole(SETTING, found):
            self.write(SETTING, content)
        for name in originals:
            self.digests.add({name: describe_file((self.path / name).read_bytes())})

    def append(self, rows: Sequence[Sequence[object]]) -> list[int]:
        """Write finished missions, which then survive a kill of this process.

        Returns:
            The place of each row in the table.
        """
        if not rows:
            return []
        self._note_growth()
        return self.table.append(rows)

    def _note_growth(self) -> None:
        self.digests.add({MISSIONS: self._growing})

    def finish(self, order: Callable[[Mapping[str, str]], tuple[int, ...]]) -> None:
        """Put the rows of missions into the order of their keys, once all are there."""
        self.table.sort(order)
        self.digests.add({MISSIONS: Entry(self.table.hash(), "")})
        self.digests.finish()

    def write(self, name: str, content: bytes, locate: bool = True) -> None:
        """Write a file and its digests; a damaged one that it replaces is set aside.

        ``locate`` says whether the digests are to locate damage.
        """
        path = self.path / name
        self.set_aside(name)
        make_folder(path.parent)
        write_atomically(path, content)
        self.digests.add({name: describe_file(content, locate)})

    def set_aside(self, name: str) -> None:
        """Keep a copy of a file that is damaged, and report it."""
        path = self.path / name
        if path.is_file():
            content, entry = path.read_bytes(), self.digests.get(name)
            if entry is not None and self.digests.is_damaged(name, content):
                self._set_aside(name, content, find_line(content, entry))

    def _set_aside(self, name: str, content: bytes, line: str, reason: str = "") -> None:
        place = self.path / DAMAGED / name
        numbers = (place.with_name(f"{place.name}.{number}") for number in count(2))
        kept = next(each for each in chain([place], numbers) if not each.exists())
        make_folder(kept.parent)
        write_atomically(kept, content)
        LOGGER.warning(
            "%s%s: damaged (a bad disk, or an editor)%s; made anew, and what was there is in %s",
            self.path / name,
            line,
            reason,
            kept,
        )

    def write_once(self, name: str, content: str) -> None:
        """Write a table that follows from the missions, or compare it with the one on disk.

        Raises:
            InputError: the table on disk differs, and is not damaged.
        """
        path, written = self.path / name, content.encode()
        found = path.read_bytes() if path.exists() else None
        entry = describe_file(written)
        if found == written:
            self.digests.add({name: entry})
        elif found is None or (self.digests.get(name) == entry):
            self.write(name, written)
        else:
            raise self.refuse(name, "replaying the run gives another table than the recorded one")

    def require_conditions(self, mission: Mission, recorded: str) -> None:
        """Require that a mission was recorded under the draws and the case that it has now.

        Raises:
            InputError: it was not.
        """
        if recorded != mission.conditions:
            raise self.refuse(
                MISSIONS,
                f"the mission {mission.key} was recorded under the draws {recorded}, not "
                f"{mission.conditions}",
            )

    def refuse(self, name: str, problem: str) -> InputError:
        """Return the error for a file that is not as this evoros would write it."""
        return InputError(
            f"{self.path / name}: {problem}: the folder was made by another version or has been "
            f"edited; start a new one"
        )

    def keep_log(self, mission: Mission, log: str) -> None:
        """Write what the controller of a lost mission printed, for its user to read."""
        folder = self.path / LOST
        make_folder(folder)
        name = f"{mission.generation:05d}_{mission.design_id}_{mission.world}_{mission.trial}.log"
        write_atomically(folder / name, log)

    def write_status(self, status: Mapping[str, Any]) -> None:
        """Write the progress, the one file that is overwritten all the time."""
        write_atomically(self.path / STATUS, seal_json(status))

    def read_status(self) -> dict[str, Any]:
        """Read the last status; empty if there is none."""
        return read_json(self.path / STATUS)
