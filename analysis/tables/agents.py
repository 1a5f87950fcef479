"""Views of a run that contain a single robot, for figures and exports."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from evoros.base.errors import InputError
from evoros.storage.figure_context import FigureContext
from evoros.storage.reading import Run
from evoros.storage.tables import AGENT, CANDIDATE_COLUMNS, MEASURED_COLUMNS, MISSION_COLUMNS

from .champions import find_shown
from .records import Record
from .study import AnyRecord, Study
from .tracks import read_track, select_robot, select_trajectory
from .treatments import SINGLE

FIRST = "first robot"
GROUPS = ("robot", "design", "controller")  # configuration groups of an agent


@dataclass(frozen=True)
class _AgentRun(Run):
    """A run reduced to one agent, with the columns of a run with a single robot."""

    whole: Run
    context: FigureContext  # context of the first robot, which contains the contexts of all agents
    agent: str
    designed: str  # name of the robot whose design the agent uses; empty for the first robot

    @cached_property
    def missions(self) -> pd.DataFrame:
        return self._select_columns(self.whole.missions, MISSION_COLUMNS, self.agent)

    @cached_property
    def generations(self) -> pd.DataFrame:
        common = (*CANDIDATE_COLUMNS, *MEASURED_COLUMNS)
        table = self.whole.generations
        return self._select_columns(table, common, self.designed) if self.designed else table

    @cached_property
    def champion(self) -> pd.DataFrame:
        return self._select_rows(self.whole.champion)

    @cached_property
    def genes(self) -> pd.DataFrame:
        return self._select_rows(self.whole.genes)

    def champion_file(self, name: str, agent: str = "") -> Path:
        return self.whole.champion_file(name, agent)

    def _select_rows(self, table: pd.DataFrame) -> pd.DataFrame:
        return select_robot(table, self.designed).drop(columns=AGENT, errors="ignore")

    def trajectory(self, world: str) -> pd.DataFrame:
        return select_trajectory(self.whole.trajectory(world), self.agent)

    def mission_trajectory(
        self, generation: int, design: int, world: str, trial: int
    ) -> pd.DataFrame:
        whole = self.whole.mission_trajectory(generation, design, world, trial)
        return select_trajectory(whole, self.agent)

    @staticmethod
    def _select_columns(table: pd.DataFrame, common: Collection[str], robot: str) -> pd.DataFrame:
        prefix = f"{robot}."
        names = [name for name in map(str, table) if name in common or name.startswith(prefix)]
        return table[names].rename(columns=lambda name: str(name).removeprefix(prefix))


def select_agent(record: AnyRecord, name: str) -> AnyRecord:
    """Return a run's record, reduced to one of its agents."""
    whole = record.run
    has_design = any(key.startswith(f"agents.{name}.design.") for key in record.values)
    designed = name if has_design else ""
    return replace(
        record,
        run=_AgentRun(whole.path, whole, record.context, name, designed),
        context=record.context.agents[name],
        values=_select_values(record.values, name),
        agent=name,
    )


def list_robots(record: Record) -> list[Record]:
    """Return one record of the run per robot."""
    whole = record
    if isinstance(record.run, _AgentRun):
        whole = replace(record, run=record.run.whole, context=record.run.context, agent="")
    return [whole, *(select_agent(whole, name) for name in whole.context.agents)]


def read_tracks(record: Record, world: str) -> pd.DataFrame:
    """Read the tracks of all robots; if there are several, the last column names the robot."""
    robots, design = list_robots(record), find_shown(record)
    tracks = [read_track(robot.run, robot.context, world, design) for robot in robots]
    if len(tracks) == 1:
        return tracks[0]
    named = [track.assign(agent=robot.agent) for track, robot in zip(tracks, robots, strict=True)]
    return pd.concat([track for track in named if len(track)] or named[:1], ignore_index=True)


def _select_values(values: Mapping[str, Any], agent: str) -> dict[str, Any]:
    start = f"agents.{agent}."
    parts = {key.removeprefix(start): v for key, v in values.items() if key.startswith(start)}
    groups = [group for group in GROUPS if any(key.startswith(f"{group}.") for key in parts)]
    others = {key: v for key, v in values.items() if key.partition(".")[0] not in groups}
    return others | {key: v for key, v in parts.items() if key.partition(".")[0] in groups}


class Choice(NamedTuple):
    """A study with one robot per run, its name (empty if alone), and the other robots' names."""

    study: Study
    robot: str = ""
    others: Sequence[str] = ()


def choose_robot(study: Study, agent: str | None) -> Choice:
    """Reduce a study to the first robot of each run, or to the given agent where present."""
    several = (*study.records, *study.evaluations)
    known = list(dict.fromkeys(name for record in several for name in record.context.agents))
    if agent not in (None, *known):
        if not known:
            raise InputError("--agent: each run has a single robot; leave the option out")
        raise InputError(
            f"--agent: no run has an agent {agent!r}; choose one of {', '.join(known)}, or leave "
            f"the option out"
        )
    if not known:
        return Choice(study)
    shown = replace(
        study,
        records=tuple(_show_robot(study, study.records, agent)),
        evaluations=tuple(_show_robot(study, study.evaluations, agent)),
        given=tuple(_show_robot(study, study.given, agent)),
    )
    if agent is None:
        return Choice(shown, f"the {FIRST}", known)
    return Choice(shown, agent, [f"the {FIRST}", *(name for name in known if name != agent)])


def _show_robot(
    study: Study, records: Iterable[AnyRecord], agent: str | None
) -> Iterator[AnyRecord]:
    for record in records:
        agents, label = record.context.agents, agent or FIRST
        if agent is not None and agent not in agents:
            study.report(f"{record.path}: no robot {agent}")
            continue
        chosen = record if agent is None else select_agent(record, agent)
        treatment = label if record.treatment == SINGLE else f"{record.treatment}, {label}"
        yield replace(chosen, treatment=treatment) if agents else record
