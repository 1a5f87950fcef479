"""Designs with stored missions, and evaluations as runs whose champion is such a design."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from evoros.base.errors import InputError
from evoros.mission.plan import EVALUATION
from evoros.storage.figure_context import FigureContext
from evoros.storage.layout import ROBOT_AS_LOADED
from evoros.storage.reading import Run
from evoros.storage.trajectory_files import loaded_robot_file, robot_file, trajectory_file
from evoros.world.model import World

from . import designs, tracks
from .champions import adapt_context, find_shown, read_champion_sensors, read_champion_signals
from .records import EvaluationRecord, Record
from .study import Study, read_complete


class ShownMission(NamedTuple):
    """A stored mission."""

    row: "pd.Series[str]"  # row of the mission in ``missions.csv``
    trajectory: pd.DataFrame
    world: World
    ground: str  # key of the world, equal for missions in the same world


@dataclass(frozen=True, eq=False)
class ShownDesign:
    """A design of the first robot, its sensors, and a mission in each world."""

    record: Record
    design: int | str
    context: FigureContext  # context with the evolved sensor types
    sensors: pd.DataFrame
    signals: pd.DataFrame  # sensors without rays
    missions: Sequence[ShownMission]


def read_champion_shown(record: Record) -> ShownDesign:
    """Read the champion of a finished run."""
    worlds = tracks.load_champion_worlds(record.run, record.context)
    missions = [
        ShownMission(
            tracks.find_champion_mission(record.run, name), record.run.trajectory(name), world, name
        )
        for name, world in worlds.items()
    ]
    return ShownDesign(
        record,
        int(record.run.champion["design"].iloc[0]),
        adapt_context(record),
        read_champion_sensors(record),
        read_champion_signals(record),
        _require_rows(record, missions),
    )


def has_missions(record: Record, design: int) -> bool:
    """Return True if a run has stored the first missions of a design."""
    try:
        rows = [
            tracks.find_first_mission(record.run, design, world) for world in record.context.courses
        ]
    except InputError:
        return False
    return all(is_kept(record, row) for row in rows)


def keeps_shown(record: Record) -> bool:
    """Return True if a run is finished or has stored its current best design's first missions."""
    try:
        design = read_complete(record, find_shown)
    except InputError:
        return False
    return design is None or has_missions(record, design)


def is_kept(record: Record, row: "pd.Series[str]") -> bool:
    """Return True if a run has stored the trajectory of a mission."""
    return (record.path / trajectory_file(tracks.find_key(row))).is_file()


def _read_kept(record: Record, row: "pd.Series[str]") -> ShownMission:
    trajectory = record.run.mission_trajectory(*tracks.find_key(row))
    world = tracks.load_mission_world(record.run, record.context, row)
    ground = f"{record.name}/{tracks.find_mission_world(record.run, row).stem}"
    return ShownMission(row, trajectory, world, ground)


def read_shown(
    record: Record,
    design: int,
    read_mission: Callable[[Record, "pd.Series[str]"], ShownMission] = _read_kept,
) -> ShownDesign:
    """Read any design of a run, and its first mission in each world with ``read_mission``."""
    names = record.context.courses
    missions = [
        read_mission(record, tracks.find_first_mission(record.run, design, name)) for name in names
    ]
    table = designs.read_generations(record)
    rows = table[table.id == design].iloc[-1:]
    context = designs.adapt_types(record.context, designs.read_evolved(record, design))
    return ShownDesign(
        record,
        design,
        context,
        designs.place_candidates(rows, record),
        designs.place_signals(designs.list_mounts(rows, record), context),
        _require_rows(record, missions),
    )


def _require_rows(record: Record, missions: Sequence[ShownMission]) -> list[ShownMission]:
    run = [mission for mission in missions if len(mission.trajectory)]
    if not run:
        raise InputError(f"{record.path}: none of the missions was run; choose another run")
    return run


KEEPING = "evaluate with requirements, or with record=all"
_KEY = ["source", "design"]
# columns that rank missions, and whether lower values are worse
_WORST_FIRST = {"completed": True, "progress": True, "collisions": False, "time_s": False}


@dataclass(frozen=True)
class _WorstRun(Run):
    """An evaluation as a run whose champion is the design with the worst stored mission."""

    record: EvaluationRecord
    source: str
    design: str
    missions: pd.DataFrame  # one mission per world, worst first

    @cached_property
    def champion(self) -> pd.DataFrame:
        return self._select(self.record.mounts)

    @cached_property
    def genes(self) -> pd.DataFrame:
        return self._select(self.record.genes)

    def _select(self, table: pd.DataFrame) -> pd.DataFrame:
        rows = (table[_KEY].astype(str) == [self.source, self.design]).all(axis=1)
        number = int(self.missions["design"].iloc[0])
        return table[rows].drop(columns="source").assign(design=number)

    def trajectory(self, world: str) -> pd.DataFrame:
        return self._read_trajectory(
            str(trajectory_file(tracks.find_key(tracks.find_champion_mission(self, world))))
        )

    def champion_file(self, name: str, agent: str = "") -> Path:
        row = self.missions.iloc[0]
        files = {
            "robot.urdf": robot_file(row["design"], agent),
            ROBOT_AS_LOADED: loaded_robot_file(row["design"], agent),
        }
        world = name.removeprefix("world_").removesuffix(".sdf")
        if world in set(self.missions["world"]):
            return tracks.find_mission_world(self, tracks.find_champion_mission(self, world))
        return self.path / files.get(name, name)


def show_worst(study: Study, name: str | None) -> tuple[Study, list[str]]:
    """Reduce a study without runs to its worst stored mission; also return a message."""
    if study.records or not study.evaluations:
        return study, []
    candidates = study.keep(study.evaluations)
    given = candidates.records if name is None else [candidates.find(name)]
    if len(given) == 1:
        found = [_find_worst(given[0])]
    else:
        found = [worst for _, worst in study.read_each(given, _find_worst)]
    if not found:
        raise InputError(f"no evaluation has kept the trajectory of a mission; {KEEPING}")
    firsts = [record.run.missions.iloc[:1] for record in found]
    chosen = found[int(_sort(pd.concat(firsts, ignore_index=True)).index[0])]
    assert isinstance(chosen.run, _WorstRun)
    row = chosen.run.missions.iloc[0]
    about = f"design {chosen.run.design}, trial {row['trial']} in {row['world']}"
    return study.keep([chosen]), [f"{chosen.name}: the worst kept mission is {about}"]


def _find_worst(record: Record) -> Record:
    assert isinstance(record, EvaluationRecord)
    ranked = _sort(list_kept(record))
    if ranked.empty:
        raise InputError(f"{record.path}: no trajectory of a mission was kept; {KEEPING}")
    of_design = ranked[ranked["number"] == ranked["number"].iloc[0]]
    return show_missions(record, of_design.drop_duplicates("world"))


def list_kept(record: EvaluationRecord) -> pd.DataFrame:
    """List the missions with stored trajectories, with the ``number`` of each design."""
    designs = record.mounts[_KEY].astype(str).drop_duplicates().to_numpy().tolist()
    numbers = {(source, design): number for number, (source, design) in enumerate(designs)}
    missions = record.run.missions.astype(dict.fromkeys(_KEY, str))
    keys = zip(missions["source"], missions["design"], strict=True)
    missions = missions.assign(number=[numbers[key] for key in keys], generation=0)
    rows = zip(missions["number"], missions["world"], missions["trial"], strict=True)
    files = [trajectory_file((0, number, world, trial)) for number, world, trial in rows]
    return missions[[(record.path / file).is_file() for file in files]]


def show_missions(record: EvaluationRecord, missions: pd.DataFrame) -> Record:
    """Return an evaluation as a run whose champion flew some missions from ``list_kept``."""
    source, design, number = missions.iloc[0][[*_KEY, "number"]]
    shown = missions.drop(columns="number").assign(design=number, purpose=EVALUATION)
    run = _WorstRun(record.path, record, source, design, shown)
    courses = {world: record.context.courses[world] for world in shown["world"]}
    context = replace(record.context, courses=courses)
    return Record(record.name, run, context, record.values, record.treatment, record.levels)


def _sort(missions: pd.DataFrame) -> pd.DataFrame:
    names = [name for name in _WORST_FIRST if name in missions]
    return missions.sort_values(
        names, ascending=[_WORST_FIRST[name] for name in names], kind="stable"
    )
