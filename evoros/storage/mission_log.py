"""The folder of a run or an evaluation, created atomically and written by one process.

Every finished mission is on disk before its outcome is used, and no content is ever overwritten
with other content; so a run that was killed goes on with the first mission that is missing.
"""

import errno
import os
from collections.abc import Callable, Collection, Mapping, Sequence
from itertools import chain, count
from pathlib import Path
from typing import Any, Self

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.files.disk import make_folder, require_no_links, separate, write_atomically
from evoros.mission.mission import Mission
from evoros.mission.scenario import Scenario
from evoros.storage.digests import (
    DigestLog,
    Entry,
    describe_file,
    describe_growing,
    find_line,
    is_whole,
)
from evoros.storage.file_reading import read_bytes
from evoros.storage.layout import (
    DAMAGED,
    DIGESTS,
    FINISHED,
    LOG,
    LOST,
    MANIFEST,
    MISSIONS,
    SETTING,
    STATUS,
    read_json,
)
from evoros.storage.mission_table import MissionTable
from evoros.storage.originals import FOREIGN, find_foreign
from evoros.storage.repairs import Repair, Report
from evoros.storage.run_key import STATUS_KEY, is_foreign, read_key, read_status_key
from evoros.storage.seals import seal_json
from evoros.storage.trajectory_files import TrajectoryFiles
from evoros.storage.verification import has_all_digests

CHANGED = "not as it was when it was finished, though each row is whole"
UNWANTED = "of missions that it never asks for"
"""Problems of a table of missions, and the first one of digests, too."""


class MissionLog:
    """An open folder, which no other process can open for writing.

    ``header`` has the columns of the table of missions; ``report`` receives the repairs.
    """

    def __init__(self, path: Path, header: Sequence[str], report: Report) -> None:
        self.path, self._report = path, report
        require_no_links(path)
        for name in (MISSIONS, DIGESTS, LOG):  # to which it appends
            separate(path / name)
        self._manifest = manifest = read_json(path / MANIFEST)
        self.table = MissionTable(path, header, read_key(manifest), report)
        self.digests = DigestLog(path, report)
        self._has_lost_digests = False
        if find_foreign(path, manifest, self.digests.entries) == DIGESTS:
            self.digests.discard(FOREIGN)
        elif not self.digests.damaged and (status := self.read_status()).get("state") == FINISHED:
            self._has_lost_digests = not has_all_digests(path, status)
        self.trajectories = TrajectoryFiles(path, self.digests, self.write)
        self._growing = {MISSIONS: describe_growing(self.table.header)}

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
        if self._has_lost_digests:
            self._report(Repair(self.path / DIGESTS, problem=CHANGED))
        damage = dict(self.table.damage)
        if self._finished_hash():  # no kill has cut its last row short
            damage |= self.table.cut
        if damage:
            lines = ", ".join(map(str, sorted(damage)))
            self.digests.add(self._growing)
            self._set_aside(MISSIONS, b"".join(damage.values()), f": line {lines}")
            self.table.mend()
        elif self._has_changed():
            self.digests.add(self._growing)
            self._report(Repair(self.path / MISSIONS, problem=CHANGED))
        path = self.path / SETTING
        if not path.is_file():
            self._report(Repair(path))
        if not path.is_file() or not self.digests.is_whole(SETTING, read_bytes(path)):
            self.write(SETTING, setting.encode())
        for name in originals:
            self.digests.add({name: describe_file(read_bytes(self.path / name))})

    def _has_changed(self) -> bool:
        """Whether the table of missions is not the one that was finished."""
        return self._finished_hash() not in ("", self.table.hash())

    def _finished_hash(self) -> str:
        """Return the SHA-256 of the table of missions as it was finished; empty if it was not."""
        entry = self.digests.entries.get(MISSIONS)
        return entry.sha256 if entry else ""

    def append(self, rows: Sequence[Sequence[object]]) -> list[int]:
        """Write finished missions, which then survive a kill of this process.

        Returns:
            The place of each row in the table.
        """
        if not rows:
            return []
        self.digests.add(self._growing)
        return self.table.append(rows)

    def keep_trajectory(self, scenario: Scenario, mission: Mission, trajectory: Array) -> None:
        """Write the trajectory of a mission, before its row."""
        self.trajectories.keep(scenario, mission, trajectory)

    def finish(
        self, order: Callable[[Mapping[str, str]], tuple[int, ...]], unwanted: Collection[int] = ()
    ) -> None:
        """Put the rows of missions into the order of their keys, once all are there.

        Rows at ``unwanted`` places are set aside: they are of missions that nobody has asked for.
        """
        if unwanted:
            self.digests.add(self._growing)
            rows = self.table.take_out(unwanted)
            where = f": line {', '.join(map(str, rows))}"
            self._set_aside(MISSIONS, b"".join(rows.values()), where, UNWANTED)
        self.table.sort(order)
        self.table.sync()  # before its digest
        self.digests.add({MISSIONS: Entry(self.table.hash(), "")})
        self.digests.finish()

    def write(self, name: str, content: bytes, locate: bool = True) -> None:
        """Write a file and its digests, which ``locate`` damage; set a damaged one aside."""
        path = self.path / name
        self.set_aside(name)
        self.make_folder(path.parent)
        write_atomically(path, content)
        self.digests.add({name: describe_file(content, locate)})

    def set_aside(self, name: str) -> None:
        """Keep a copy of a file that is complete and damaged, and report it."""
        path, entry = self.path / name, self.digests.entries.get(name)
        if entry is not None and entry.sha256 and path.is_file():
            content = read_bytes(path)
            if not is_whole(content, entry):
                self._set_aside(name, content, find_line(content, entry))

    def _set_aside(self, name: str, content: bytes, where: str, problem: str = "") -> None:
        place = self.path / DAMAGED / name
        copies = (place.with_name(f"{place.name}.{index}") for index in count(2))
        kept = next(copy for copy in chain([place], copies) if not copy.exists())
        self.make_folder(kept.parent)
        write_atomically(kept, content)
        self._report(Repair(self.path / name, where, kept, problem))

    def write_once(self, name: str, content: str) -> None:
        """Write a table that follows from the missions, or compare it with the one on disk.

        Raises:
            InputError: the table on disk differs, and is not damaged.
        """
        path, written = self.path / name, content.encode()
        entry = describe_file(written)
        if path.exists() and read_bytes(path) == written:
            self.digests.add({name: entry})
        elif not path.exists() or self.digests.entries.get(name) == entry:
            self.write(name, written)
        elif name not in self.digests.entries:  # a file of somebody else
            self._set_aside(name, read_bytes(path), "")
            self.write(name, written)
        else:
            raise self.refuse(name, "replaying the run gives another table than the recorded one")

    def require_conditions(self, mission: Mission, recorded: str) -> None:
        """Require that a mission was recorded under the draws and the case that it has now."""
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

    def make_folder(self, folder: Path) -> None:
        """Create a folder inside, but not this folder itself, which somebody may have moved away.

        Raises:
            FileNotFoundError: this folder is not there any more.
        """
        if not self.table.path.exists():
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(self.table.path))
        make_folder(folder)

    def keep_log(self, mission: Mission, log: str) -> None:
        """Write the output of the controller of a lost mission, for its user to read."""
        generation, design, world, trial = mission.key
        self.make_folder(self.path / LOST)
        file = self.path / LOST / f"{generation:05d}_{design}_{world}_{trial}.log"
        write_atomically(file, log)

    def write_status(self, status: Mapping[str, Any]) -> None:
        """Write the progress, the one file that is overwritten all the time."""
        known = {**status, STATUS_KEY: read_status_key(self._manifest)}
        write_atomically(self.path / STATUS, seal_json(STATUS, known))

    def read_status(self) -> dict[str, Any]:
        """Read the last status; empty if there is none, or if it is of another run."""
        status = read_json(self.path / STATUS)
        return {} if is_foreign(status, self._manifest) else status
