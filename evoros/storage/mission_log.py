"""The folder of a run or an evaluation, created atomically and written by one process.

Every finished mission is on disk before its outcome is used, and no content is ever overwritten
with other content; so a run that was killed goes on with the first mission that is missing.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Self

from evoros.base.disk import make_folder, write_atomically
from evoros.base.errors import InputError
from evoros.mission.mission import Mission
from evoros.storage.layout import LOST, STATUS, read_json
from evoros.storage.mission_table import MissionTable


class MissionLog:
    """An open folder, which no other process can open for writing.

    ``header`` has the columns of the table of missions.
    """

    def __init__(self, path: Path, header: Sequence[str]) -> None:
        self.path = path
        self.table = MissionTable(path, header)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Release the folder to other processes."""
        self.table.close()

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
