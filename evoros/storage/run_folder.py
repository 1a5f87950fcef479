"""A run folder on disk. The folder is the run: nothing is ever overwritten with other content.

Resuming replays the optimizer with the missions on disk and goes on with the first one that is
missing.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from evoros.base.errors import InputError
from evoros.mission.mission import Mission, MissionKey
from evoros.mission.outcome import Outcome
from evoros.storage.figure_context import SETTING, FigureContext
from evoros.storage.mission_log import (
    CONFIG,
    MANIFEST,
    MISSIONS,
    MissionLog,
    create_folder,
    require_unused,
    write_atomically,
)
from evoros.storage.tables import MISSIONS_HEADER, mission_row, read_mission, to_csv

GENERATIONS, CHAMPION = "generations", "champion"


class RunFolder(MissionLog):
    """An open run folder.

    ``outcomes`` has every finished mission, by generation, design, world and trial.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path, MISSIONS_HEADER)
        self.outcomes: dict[MissionKey, tuple[str, Outcome]] = {}
        try:
            for place, draws, outcome in self.read(read_mission):
                self.outcomes[place] = (draws, outcome)
        except BaseException:
            self._missions.close()
            raise

    @classmethod
    def create(
        cls, path: Path, config: str, manifest: Mapping[str, Any], setting: FigureContext
    ) -> "RunFolder":
        """A new run in a folder that does not exist or is empty.

        Raises:
            InputError: the folder holds a run, or other files; nothing was changed.
        """
        require_unused(path)
        described = json.dumps(manifest, indent=2) + "\n"
        files = {CONFIG: config, MANIFEST: described, SETTING: setting.text}
        create_folder(path, {**files, MISSIONS: to_csv([MISSIONS_HEADER])})
        return cls(path)

    def record(self, flown: Sequence[tuple[Mission, Outcome]]) -> None:
        """Put finished missions on disk."""
        self.append([mission_row(mission, outcome) for mission, outcome in flown])
        self.outcomes |= {mission.key: (mission.draws, outcome) for mission, outcome in flown}

    def has(self, mission: Mission) -> bool:
        """Whether the mission has been recorded.

        Raises:
            InputError: it was recorded under other draws.
        """
        return self.find(mission) is not None

    def find(self, mission: Mission) -> Outcome | None:
        """The recorded outcome of the mission.

        Raises:
            InputError: it was recorded under other draws.
        """
        draws, outcome = self.outcomes.get(mission.key, ("", None))
        if outcome is not None and draws != mission.draws:
            raise InputError(
                f"{self.path / MISSIONS}: the mission {mission.key} was recorded under the draws "
                f"{draws}, not {mission.draws}: the run was made by another version or has been "
                f"edited; start a new run"
            )
        return outcome

    def write_generation(self, number: int, content: str) -> None:
        """A generation's table; a replayed one must equal what is on disk.

        Raises:
            InputError: it does not.
        """
        self.write_once(f"{GENERATIONS}/{number:05d}.csv", content)

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
