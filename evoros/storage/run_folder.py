"""The run folder, which records a search or an evaluation on disk."""

from collections.abc import Callable, Mapping, Sequence
from itertools import count
from pathlib import Path
from typing import Any

from evoros.base.arrays import Array
from evoros.dispatch.dispatcher import MissionResult
from evoros.evolution.experiment import ALL
from evoros.evolution.journal import Champion, Champions, Generation
from evoros.files.disk import sync
from evoros.mission.mission import Mission, MissionKey, Outcomes, name_conditions
from evoros.mission.plan import SELECTION
from evoros.storage import champion_files, layout, tables
from evoros.storage.creation import create_folder, require_unused
from evoros.storage.digests import Report, describe_file, ignore
from evoros.storage.figure_context import FigureContext
from evoros.storage.layout import read_bytes, read_rows, seal_json
from evoros.storage.mission_log import MissionLog
from evoros.storage.mission_table import DESIGN, GENERATION, MissionRows, Recorded, begin_table

GENERATIONS = "generations"
RESULTS = (layout.SCORES, layout.WORST_CASES, layout.REQUIREMENTS, layout.JUNIT, layout.SUMMARY)
"""Files that an evaluation derives from all of its missions."""
DesignName = tuple[str, str]  # source of a given design, and its name in the source


class RunFolder(MissionLog):
    """An open run folder.

    ``rows`` locates the finished missions. Rows of an evaluation contain names of designs; the id
    of a design is its index in ``designs_in.csv``.
    """

    def __init__(self, path: Path, report: Report = ignore) -> None:
        manifest = layout.read_json(path / layout.MANIFEST)
        columns: list[str] = manifest.get(layout.COLUMNS, [])
        self._states_cases = tables.CASE in columns
        self._further = [name for name in tables.FURTHER_COLUMNS if name in columns]
        self._names = _read_names(path) if layout.evaluates(path) else []
        self._ids = {name: index for index, name in enumerate(self._names)}
        super().__init__(path, columns, report)
        self.keeps_all = manifest.get("record") == ALL  # whether all trajectories are stored
        self._agents: list[str] = manifest.get(layout.AGENTS, [])
        try:
            self.rows = self._locate(lambda row: self.read_mission(row)[0])
        except BaseException:
            self.close()
            raise

    def _locate(self, read: Callable[[Mapping[str, str]], MissionKey] | None = None) -> MissionRows:
        """Locate the rows of all missions; treat repeated rows as damaged."""
        group = DESIGN if self._names else GENERATION
        rows = MissionRows(lambda place: self.table.read_row(place, self.read_mission), group)
        known: set[MissionKey] = set()
        for key in self.table.read(read or self._read_key):
            if key in known:
                self.table.reject()
            else:
                known.add(key)
                rows.note(key, self.table.place)
        return rows

    def _read_key(self, row: Mapping[str, str]) -> MissionKey:
        if not self._names:
            return tables.read_key(row)
        return 0, self._ids[row["source"], row["design"]], row["world"], int(row["trial"])

    def read_mission(self, row: Mapping[str, str]) -> Recorded:
        """Read a mission from a row; raise ValueError or KeyError if another version wrote it."""
        return (
            self._read_key(row),
            name_conditions(row["draws"], row.get(tables.CASE, "")),
            tables.read_outcomes(row, self._agents),
        )

    def _write_row(self, mission: Mission, outcomes: Outcomes) -> list[object]:
        key: list[object] = [*mission.key, mission.purpose, mission.draws]
        if self._names:
            name = self._names[mission.design_id]
            key = [*name, mission.world, mission.trial, mission.draws]
        case = [mission.stated] if self._states_cases else []
        return [*key, *tables.outcome_cells(outcomes, self._further), *case]

    def mend(self, setting: str) -> None:
        """Repair the folder, and locate the rows again if they have moved."""
        moved = bool(self.table.damage)
        super().mend(setting)
        if moved:
            self.rows = self._locate()

    @classmethod
    def create(
        cls,
        path: Path,
        config: str,
        manifest: Mapping[str, Any],
        setting: FigureContext,
        designs: Mapping[str, str] | None = None,
    ) -> "RunFolder":
        """Create the folder of a new run; an existing folder must be empty."""
        require_unused(path)
        files = {
            layout.CONFIG: config,
            layout.MANIFEST: seal_json(layout.MANIFEST, manifest),
            layout.SETTING: setting.text,
        }
        table = {layout.MISSIONS: begin_table(manifest.get(layout.COLUMNS, ()))}
        create_folder(path, {**files, **(designs or {}), **table})
        return cls(path)

    def record(self, results: Sequence[MissionResult]) -> None:
        """Write finished missions; a repeated mission must have the recorded outcome."""
        new = results
        if self.keeps_all:  # missions are repeated only if trajectories were lost
            new = [result for result in results if not self._repeats(*result)]
        places = self.append([self._write_row(*result) for result in new])
        self.rows.add(
            [(mission.key, mission.conditions, outcomes) for mission, outcomes in new], places
        )

    def _repeats(self, mission: Mission, outcomes: Outcomes) -> bool:
        recorded = self.find(mission)
        if recorded is None:
            return False
        if not tables.are_recorded(outcomes, recorded, self._agents):
            raise self.refuse(
                layout.MISSIONS,
                f"the trajectory of mission {mission.key} was missing, and rerunning the mission "
                f"gives an outcome that differs from the recorded one",
            )
        return True

    def has(self, mission: Mission) -> bool:
        """Return True if a mission is recorded, with its trajectory if all are stored."""
        recorded = self.find(mission) is not None
        return recorded and (self.trajectories.has(mission) or not self.keeps_all)

    def drop_trajectories(self, missions: Sequence[Mission]) -> list[Mission]:
        """Delete the trajectories of all other missions; return the missions without one."""
        self.trajectories.retain(missions)
        return [mission for mission in missions if not self.trajectories.has(mission)]

    def read_trajectory(self, mission: Mission) -> Array:
        """Read the stored trajectory of a mission."""
        return self.trajectories.read(mission)

    def find(self, mission: Mission) -> Outcomes | None:
        """Return the recorded outcomes of a mission, or None."""
        row = self.rows.find(mission.key)
        if row is None:
            return None
        conditions, outcomes = row
        self.require_conditions(mission, conditions)
        return outcomes

    def write_generation(self, generation: Generation) -> None:
        """Write the table of a generation, or compare it with the recorded table."""
        self.write_once(_generation_file(generation.number), tables.generation_table(generation))
        self.table.sync()
        if self.keeps_all:
            self.digests.sync()

    def complete(self, generations: int = 1, extended: bool = False) -> None:
        """Sort the mission rows by generation, design, world and trial."""
        ranks = {world: rank for rank, world in enumerate(sorted(self.rows.worlds))}

        def order(row: Mapping[str, str]) -> tuple[int, ...]:
            generation, design, world, trial = self._read_key(row)
            return generation, design, ranks[world], trial

        def selects(place: int) -> bool:
            row = self.table.read_row(place, dict)
            return row["purpose"] == SELECTION and int(row["generation"]) < generations

        # keep rows written when an extended search ended after fewer or more generations
        unwanted = set(self.rows.find_unwanted())
        self.finish(order, set(filter(selects, unwanted)) if extended else unwanted)
        self.rows = self._locate()

    def write_champions(self, champions: Champions) -> None:
        """Write the files of several champions, which replace those from before an extension."""
        if len(champions.designs) < 2 and not (self.path / champion_files.CHAMPIONS).is_dir():
            return
        for name, content in champion_files.champions_files(champions).items():
            if self._read(name) == content:
                self.digests.add({name: describe_file(content)})
            else:
                self.write(name, content)

    def has_champion(self, champion: Champion) -> bool:
        """Return True if this champion is recorded with its stored trajectories."""
        files = champion_files.champion_files(champion)
        whole = all(self._read(name) == content for name, content in files.items())
        if whole:  # restores digests, which may be damaged
            self.digests.add({name: describe_file(content) for name, content in files.items()})
        tracks = map(champion_files.track_file, champion.tracks)
        return whole and all(self.digests.is_whole(name, self._read(name)) for name in tracks)

    def _read(self, name: str) -> bytes:
        path = self.path / name
        return read_bytes(path) if path.is_file() else b""

    def write_champion(self, champion: Champion, trajectories: Mapping[str, Array]) -> None:
        """Replace the champion's files; ``design.csv`` exists only while all others do."""
        files = {
            **champion_files.track_files(champion, trajectories),
            **champion_files.champion_files(champion),
        }
        for name in files:
            self.set_aside(name)
        folder = self.path / champion_files.CHAMPION
        self.make_folder(folder)
        self.digests.reopen(files)
        (self.path / list(files)[-1]).unlink(missing_ok=True)
        sync(folder)
        for name, content in files.items():
            self.write(name, content)

    def discard_results(self) -> None:
        """Delete the results of a continued evaluation, which writes them again at its end."""
        written = self.digests.entries.keys() & RESULTS
        names = [name for name in written if (self.path / name).is_file()]
        self.digests.reopen(names)
        for name in names:
            (self.path / name).unlink()

    def count_generations(self) -> int:
        """Return the number of consecutive generations, from the first, with tables."""
        return next(n for n in count() if _generation_file(n) not in self.digests.entries)


def _generation_file(generation: int) -> str:
    return f"{GENERATIONS}/{generation:05d}.csv"


def _read_names(path: Path) -> list[DesignName]:
    rows = read_rows(path / layout.DESIGN_FILE)
    return list(dict.fromkeys((row["source"], row["design"]) for row in rows))
