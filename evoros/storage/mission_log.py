"""A run's folder, written by one process; outcomes count once their missions are on disk."""

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
from evoros.storage import digests, layout
from evoros.storage.layout import read_bytes, seal_json
from evoros.storage.mission_table import MissionTable
from evoros.storage.run_key import STATUS_KEY, is_foreign, read_key, read_status_key
from evoros.storage.trajectory_files import TrajectoryFiles
from evoros.storage.verification import has_all_digests

CHANGED = "has changed since it was finished, although each row is undamaged"
UNWANTED = "rows of missions that the run does not request"
"""Problems of mission tables; the first is also a problem of digests."""


class MissionLog:
    """An open folder, locked against other writing processes."""

    def __init__(self, path: Path, header: Sequence[str], report: digests.Report) -> None:
        self.path, self._report = path, report
        require_no_links(path)
        for name in (layout.MISSIONS, layout.DIGESTS, layout.LOG):  # files that grow
            separate(path / name)
        self._manifest = manifest = layout.read_json(path / layout.MANIFEST)
        self.table = MissionTable(path, header, read_key(manifest), report)
        self.digests = digests.DigestLog(path, report)
        self._has_lost_digests = False
        if digests.find_foreign(path, manifest, self.digests.entries) == layout.DIGESTS:
            self.digests.discard(digests.FOREIGN)
        elif (
            not self.digests.damaged
            and (status := self.read_status()).get("state") == layout.FINISHED
        ):
            self._has_lost_digests = not has_all_digests(path, status)
        self.trajectories = TrajectoryFiles(path, self.digests, self.write)
        self._growing = {layout.MISSIONS: digests.describe_growing(self.table.header)}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Release the lock on the folder."""
        self.table.close()

    def mend(self, setting: str) -> None:
        """Remove damaged rows, so that their missions run again, and restore ``setting.json``."""
        if self._has_lost_digests:
            self._report(digests.Repair(self.path / layout.DIGESTS, problem=CHANGED))
        damage = dict(self.table.damage)
        if self._finished_hash():  # a kill cannot truncate a finished table
            damage |= self.table.cut
        if damage:
            lines = ", ".join(map(str, sorted(damage)))
            self.digests.add(self._growing)
            self._set_aside(layout.MISSIONS, b"".join(damage.values()), f": line {lines}")
            self.table.mend()
        elif self._finished_hash() not in ("", self.table.hash()):
            self.digests.add(self._growing)
            self._report(digests.Repair(self.path / layout.MISSIONS, problem=CHANGED))
        path = self.path / layout.SETTING
        if not path.is_file():
            self._report(digests.Repair(path))
        if not path.is_file() or not self.digests.is_whole(layout.SETTING, read_bytes(path)):
            self.write(layout.SETTING, setting.encode())
        for name in layout.ORIGINALS:  # verified by the manifest, because their digests may be lost
            if (self.path / name).is_file():
                self.digests.add({name: digests.describe_file(read_bytes(self.path / name))})

    def _finished_hash(self) -> str:
        # empty for an unfinished table
        entry = self.digests.entries.get(layout.MISSIONS)
        return entry.sha256 if entry else ""

    def append(self, rows: Sequence[Sequence[object]]) -> list[int]:
        """Write missions so that they survive a kill; return the offset of each row."""
        if not rows:
            return []
        self.digests.add(self._growing)
        return self.table.append(rows)

    def keep_trajectory(self, scenario: Scenario, mission: Mission, trajectory: Array) -> None:
        """Write the trajectory of a mission, before its row is written."""
        self.trajectories.keep(scenario, mission, trajectory)

    def finish(
        self, order: Callable[[Mapping[str, str]], tuple[int, ...]], unwanted: Collection[int] = ()
    ) -> None:
        """Sort the mission rows by ``order``; set aside the rows at ``unwanted`` offsets."""
        if unwanted:
            self.digests.add(self._growing)
            rows = self.table.take_out(unwanted)
            where = f": line {', '.join(map(str, rows))}"
            self._set_aside(layout.MISSIONS, b"".join(rows.values()), where, UNWANTED)
        self.table.sort(order)
        self.table.sync()  # must precede the digest of the table
        self.digests.add({layout.MISSIONS: digests.Entry(self.table.hash(), "")})
        self.digests.finish()

    def write(self, name: str, content: bytes, locate: bool = True) -> None:
        """Write a file and its digests (per line if ``locate``); set aside a damaged version."""
        path = self.path / name
        self.set_aside(name)
        self.make_folder(path.parent)
        write_atomically(path, content)
        self.digests.add({name: digests.describe_file(content, locate)})

    def set_aside(self, name: str) -> None:
        """Keep a copy of a damaged complete file, and report the repair."""
        path, entry = self.path / name, self.digests.entries.get(name)
        if entry is not None and entry.sha256 and path.is_file():
            content = read_bytes(path)
            if not digests.is_whole(content, entry):
                self._set_aside(name, content, digests.find_line(content, entry))

    def _set_aside(self, name: str, content: bytes, where: str, problem: str = "") -> None:
        place = self.path / layout.DAMAGED / name
        copies = (place.with_name(f"{place.name}.{index}") for index in count(2))
        kept = next(copy for copy in chain([place], copies) if not copy.exists())
        self.make_folder(kept.parent)
        write_atomically(kept, content)
        self._report(digests.Repair(self.path / name, where, kept, problem))

    def write_once(self, name: str, content: str) -> None:
        """Write a table derived from missions, or check that the recorded table is equal."""
        path, written = self.path / name, content.encode()
        entry = digests.describe_file(written)
        if path.exists() and read_bytes(path) == written:
            self.digests.add({name: entry})
        elif not path.exists() or self.digests.entries.get(name) == entry:
            self.write(name, written)
        elif name not in self.digests.entries:  # this run has not written the file
            self._set_aside(name, read_bytes(path), "")
            self.write(name, written)
        else:
            raise self.refuse(name, "replaying the run gives a table that differs from the record")

    def require_conditions(self, mission: Mission, recorded: str) -> None:
        """Check that the random draws and the failure case of a mission are as recorded."""
        if recorded != mission.conditions:
            raise self.refuse(
                layout.MISSIONS,
                f"the mission {mission.key} was recorded with the draws {recorded}, not "
                f"{mission.conditions}",
            )

    def refuse(self, name: str, problem: str) -> InputError:
        """Return the error for a file whose content differs from what evoros would write."""
        return InputError(
            f"{self.path / name}: {problem}, because the folder was written by another version or "
            f"was edited; start a new run"
        )

    def make_folder(self, folder: Path) -> None:
        """Create a folder in this one; raise FileNotFoundError if this one has been deleted."""
        if not self.table.path.exists():
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(self.table.path))
        make_folder(folder)

    def keep_log(self, mission: Mission, log: str) -> None:
        """Save the controller's output in a lost mission for the user."""
        generation, design, world, trial = mission.key
        self.make_folder(self.path / layout.LOST)
        file = self.path / layout.LOST / f"{generation:05d}_{design}_{world}_{trial}.log"
        write_atomically(file, log)

    def write_status(self, status: Mapping[str, Any]) -> None:
        """Write the status, the only file that is regularly overwritten."""
        known = {**status, STATUS_KEY: read_status_key(self._manifest)}
        write_atomically(self.path / layout.STATUS, seal_json(layout.STATUS, known))

    def read_status(self) -> dict[str, Any]:
        """Read the last status; empty if missing or from a different run."""
        status = layout.read_json(self.path / layout.STATUS)
        return {} if is_foreign(status, self._manifest) else status
