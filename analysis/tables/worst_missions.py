"""The worst stored missions of an evaluation, in the form of a champion's missions."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import pandas as pd

from evoros.base.errors import InputError
from evoros.mission.plan import EVALUATION
from evoros.storage.layout import ROBOT_AS_LOADED
from evoros.storage.reading import Run
from evoros.storage.trajectory_files import loaded_robot_file, robot_file, trajectory_file

from .records import EvaluationRecord, Record
from .study import Study
from .tracks import find_champion_mission, find_key, find_mission_world

KEEPING = "evaluate with requirements, or with record=all"
_KEY = ["source", "design"]
_WORST_FIRST: Mapping[str, bool] = {
    **{"completed": True, "progress": True},
    **{"collisions": False, "time_s": False},
}
"""Columns that rank missions; true if lower values are worse."""


@dataclass(frozen=True)
class WorstRun(Run):
    """An evaluation as a run whose champion is the design with the worst stored mission."""

    record: EvaluationRecord
    source: str
    design: str
    missions: pd.DataFrame  # one mission for each world, the worst first

    @cached_property
    def champion(self) -> pd.DataFrame:
        """The design's sensors."""
        return self._select(self.record.mounts)

    @cached_property
    def genes(self) -> pd.DataFrame:
        """The evolved values of the design other than mounts."""
        return self._select(self.record.genes)

    def _select(self, table: pd.DataFrame) -> pd.DataFrame:
        rows = (table[_KEY].astype(str) == [self.source, self.design]).all(axis=1)
        number = int(self.missions["design"].iloc[0])
        return table[rows].drop(columns="source").assign(design=number)

    def trajectory(self, world: str) -> pd.DataFrame:
        """Read the trajectory of the mission in a world; see ``Run``."""
        return self._read_trajectory(str(trajectory_file(find_key(self._find(world)))))

    def champion_file(self, name: str, agent: str = "") -> Path:
        """Return the path of one of the design's files; see ``Run``."""
        row = self.missions.iloc[0]
        files = {
            "robot.urdf": robot_file(row["design"], agent),
            ROBOT_AS_LOADED: loaded_robot_file(row["design"], agent),
        }
        world = name.removeprefix("world_").removesuffix(".sdf")
        if world in set(self.missions["world"]):
            return find_mission_world(self, self._find(world))
        return self.path / files.get(name, name)

    def _find(self, world: str) -> "pd.Series[str]":
        return find_champion_mission(self, world)


def show_worst(study: Study, name: str | None) -> tuple[Study, list[str]]:
    """Show the worst stored mission of a study without runs; also return a message about it."""
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
    assert isinstance(chosen.run, WorstRun)
    row = chosen.run.missions.iloc[0]
    about = f"design {chosen.run.design}, trial {row['trial']} in {row['world']}"
    return study.keep([chosen]), [f"{chosen.name}: the worst kept mission is {about}"]


def _find_worst(record: Record) -> Record:
    assert isinstance(record, EvaluationRecord)
    designs = record.mounts[_KEY].astype(str).drop_duplicates().to_numpy().tolist()
    numbers = {(source, design): number for number, (source, design) in enumerate(designs)}
    missions = record.run.missions.astype(dict.fromkeys(_KEY, str))
    keys = zip(missions["source"], missions["design"], strict=True)
    missions = missions.assign(number=[numbers[key] for key in keys], generation=0)
    rows = zip(missions["number"], missions["world"], missions["trial"], strict=True)
    files = [trajectory_file((0, number, world, trial)) for number, world, trial in rows]
    kept = [(record.path / file).is_file() for file in files]
    ranked = _sort(missions[kept])
    if ranked.empty:
        raise InputError(f"{record.path}: no trajectory of a mission was kept; {KEEPING}")
    source, design, number = ranked.iloc[0][[*_KEY, "number"]]
    of_design = ranked[ranked["number"] == number].drop_duplicates("world")
    shown = of_design.drop(columns="number").assign(design=number, purpose=EVALUATION)
    run = WorstRun(record.path, record, source, design, shown)
    courses = {world: record.context.courses[world] for world in shown["world"]}
    context = replace(record.context, courses=courses)
    return Record(record.name, run, context, record.values, record.treatment, record.levels)


def _sort(missions: pd.DataFrame) -> pd.DataFrame:
    names = [name for name in _WORST_FIRST if name in missions]
    return missions.sort_values(
        names, ascending=[_WORST_FIRST[name] for name in names], kind="stable"
    )
