"""The run folder, the journal of an evolution on disk."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any

from evoros.base.arrays import Array
from evoros.dispatch.record import MissionResult
from evoros.evolution.experiment import ALL
from evoros.evolution.journal import Champion, Champions, Generation
from evoros.files.disk import sync
from evoros.mission.mission import Mission, MissionKey
from evoros.mission.outcome import Outcomes
from evoros.mission.plan import SELECTION
from evoros.storage.champion_files import (
    CHAMPION,
    CHAMPIONS,
    champion_files,
    champions_files,
    track_file,
    track_files,
)
from evoros.storage.creation import create_folder, require_unused
from evoros.storage.digests import describe_file
from evoros.storage.figure_context import FigureContext
from evoros.storage.file_reading import read_bytes
from evoros.storage.generation_rows import GenerationRows
from evoros.storage.layout import CONFIG, MANIFEST, MISSIONS, SETTING, read_json
from evoros.storage.mission_log import MissionLog
from evoros.storage.mission_table import begin_table
from evoros.storage.repairs import Report, ignore
from evoros.storage.seals import seal_json
from evoros.storage.tables import (
    CASE,
    MISSION_COLUMNS,
    are_recorded,
    generation_table,
    list_further,
    mission_row,
    name_outcome_columns,
    read_key,
    read_mission,
)

GENERATIONS = "generations"
STATES_CASES = "states_cases"  # in the manifest, whether missions meet stated cases
FAILS_PARTS = "fails_parts"  # in the manifest, whether other parts than sensors can fail
AGENTS = "agents"  # in the manifest, their names
WALKERS = "walkers"  # in the manifest, whether missions can have some
SHORTEST = "states_shortest"  # in the manifest, whether a world states its shortest way


class RunFolder(MissionLog):
    """An open run folder.

    ``rows`` finds the finished missions. ``keeps_all`` is True if ``trajectories`` has all of
    their trajectories.
    """

    def __init__(self, path: Path, report: Report = ignore) -> None:
        manifest = read_json(path / MANIFEST)
        self._states_cases = bool(manifest.get(STATES_CASES))
        self._further = _list_further(manifest)
        super().__init__(path, _header(manifest), report)
        self.keeps_all = manifest.get("record") == ALL
        self._agents: list[str] = manifest.get(AGENTS, [])
        self._parse = partial(read_mission, agents=self._agents)
        try:
            self.rows = self._locate(lambda row: self._parse(row)[0])
        except BaseException:
            self.close()
            raise

    def _locate(self, read: Callable[[Mapping[str, str]], MissionKey] = read_key) -> GenerationRows:
        """Find the rows of all missions; the second one of a mission counts as damaged."""
        rows = GenerationRows(lambda place: self.table.read_row(place, self._parse))
        known: set[MissionKey] = set()
        for key in self.table.read(read):
            if key in known:
                self.table.reject()
            else:
                known.add(key)
                rows.note(key, self.table.place)
        return rows

    def mend(self, setting: str, originals: Sequence[str]) -> None:
        """Mend as in every folder, and find the rows where they are then."""
        moved = bool(self.table.damage)
        super().mend(setting, originals)
        if moved:
            self.rows = self._locate()

    @classmethod
    def create(
        cls, path: Path, config: str, manifest: Mapping[str, Any], setting: FigureContext
    ) -> "RunFolder":
        """Create the folder of a new run, which must not exist or be empty.

        Raises:
            InputError: the folder has a run, or other files; nothing was changed.
        """
        require_unused(path)
        files = {CONFIG: config, MANIFEST: seal_json(MANIFEST, manifest), SETTING: setting.text}
        create_folder(path, {**files, MISSIONS: begin_table(_header(manifest))})
        return cls(path)

    def record(self, results: Sequence[MissionResult]) -> None:
        """Write finished missions.

        Raises:
            InputError: a mission whose trajectory was missing has another outcome than recorded.
        """
        new = [result for result in results if not self._repeats(*result)]
        flags = self._states_cases, self._further
        places = self.append([mission_row(*result, *flags) for result in new])
        self.rows.add(
            [(mission.key, mission.conditions, outcomes) for mission, outcomes in new], places
        )

    def _repeats(self, mission: Mission, outcomes: Outcomes) -> bool:
        """Whether the mission has a row, which must have these outcomes."""
        recorded = self.find(mission)
        if recorded is None:
            return False
        if not are_recorded(outcomes, recorded, self._agents):
            raise self.refuse(
                MISSIONS,
                f"running the mission {mission.key} again, because its trajectory was missing, "
                f"gives another outcome than the recorded one",
            )
        return True

    def has(self, mission: Mission) -> bool:
        """Whether the mission has been recorded, with its trajectory if the run keeps all."""
        recorded = self.find(mission) is not None
        return recorded and (self.trajectories.has(mission) or not self.keeps_all)

    def drop_trajectories(self, missions: Sequence[Mission]) -> list[Mission]:
        """Delete the trajectories of all other missions; return the missions that have none."""
        self.trajectories.retain(missions)
        return [mission for mission in missions if not self.trajectories.has(mission)]

    def read_trajectory(self, mission: Mission) -> Array:
        """Read the trajectory of a mission that the run has kept."""
        return self.trajectories.read(mission)

    def find(self, mission: Mission) -> Outcomes | None:
        """Return the recorded outcomes of the mission; None if there are none."""
        row = self.rows.find(mission.key)
        if row is None:
            return None
        conditions, outcomes = row
        self.require_conditions(mission, conditions)
        return outcomes

    def write_generation(self, generation: Generation) -> None:
        """Write a generation's table, or compare it with the one on disk."""
        self.write_once(_generation_file(generation.number), generation_table(generation))
        self.table.sync()
        if self.keeps_all:
            self.digests.sync()

    def complete(self, generations: int, extended: bool = False) -> None:
        """Put the rows of missions into the order of generation, design, world and trial.

        Rows of missions that none of the run's ``generations`` has asked for are set aside. If the
        run may have been ``extended``, those of an earlier or a later end stay.
        """
        ranks = {world: rank for rank, world in enumerate(sorted(self.rows.worlds))}

        def order(row: Mapping[str, str]) -> tuple[int, ...]:
            generation, design, world, trial = read_key(row)
            return generation, design, ranks[world], trial

        self.finish(order, self._find_unwanted(generations, extended))
        self.rows = self._locate()

    def _find_unwanted(self, generations: int, extended: bool) -> set[int]:
        unwanted = set(self.rows.find_unwanted())
        return {p for p in unwanted if not extended or self._selects(p, generations)}

    def _selects(self, place: int, generations: int) -> bool:
        """Whether a row is of the selection in one of so many generations."""
        row = self.table.read_row(place, dict)
        return row["purpose"] == SELECTION and int(row["generation"]) < generations

    def write_champions(self, champions: Champions) -> None:
        """Write the files of several champions, which replace an earlier end's."""
        if len(champions.designs) < 2 and not (self.path / CHAMPIONS).is_dir():
            return
        for name, content in champions_files(champions).items():
            if self._read(name) == content:
                self.digests.add({name: describe_file(content)})
            else:
                self.write(name, content)

    def has_champion(self, champion: Champion) -> bool:
        """Whether the champion on disk is this one, with the trajectories that are kept."""
        files = champion_files(champion)
        whole = all(self._read(name) == content for name, content in files.items())
        if whole:  # their digests may have been damaged
            self.digests.add({name: describe_file(content) for name, content in files.items()})
        tracks = map(track_file, champion.tracks)
        return whole and all(self.digests.is_whole(name, self._read(name)) for name in tracks)

    def _read(self, name: str) -> bytes:
        """Read a file; empty if there is none."""
        path = self.path / name
        return read_bytes(path) if path.is_file() else b""

    def write_champion(self, champion: Champion, trajectories: Mapping[str, Array]) -> None:
        """Write the champion's files, which replace an earlier end's.

        The last file names the design; it exists only while all the others do.
        """
        files = {**track_files(champion, trajectories), **champion_files(champion)}
        for name in files:
            self.set_aside(name)
        folder = self.path / CHAMPION
        self.make_folder(folder)
        self.digests.reopen(files)
        (self.path / list(files)[-1]).unlink(missing_ok=True)
        sync(folder)
        for name, content in files.items():
            self.write(name, content)

    def count_generations(self) -> int:
        """Count the tables of generations that the run has written, from the first one on."""
        return next(n for n in count() if _generation_file(n) not in self.digests.entries)


def _generation_file(generation: int) -> str:
    return f"{GENERATIONS}/{generation:05d}.csv"


def _header(manifest: Mapping[str, Any]) -> list[str]:
    case = [CASE] if manifest.get(STATES_CASES) else []
    agents, further = manifest.get(AGENTS, []), _list_further(manifest)
    return [*MISSION_COLUMNS, *name_outcome_columns(agents, further), *case]


def _list_further(manifest: Mapping[str, Any]) -> Sequence[str]:
    return list_further(*(bool(manifest.get(key)) for key in (FAILS_PARTS, WALKERS, SHORTEST)))
