"""Missions of all sets of places, measured once, in which searches then look up their missions.

A mission of a search draws its failures as always. Its outcome is then that of the set of surviving
sensors in one of the measured trials, which its draws key chooses. So a search meets exactly the
problem whose optimum is known, at a thousandth of the cost.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from drop_out import list_members
from noise import Recalled

import evoros
from evoros.base.arrays import Array
from evoros.base.rng import generator
from evoros.design.design import Design
from evoros.evolution.experiment import Experiment
from evoros.evolution.journal import Generation
from evoros.failure.protocol import make_faults
from evoros.filter.protocol import Channels
from evoros.fitness.equation_one import equation_one
from evoros.mission.mission import Mission, Outcome, Outcomes
from evoros.sensor.protocol import Mount

EXPERIMENT = "experiment=redundancy"


def list_places() -> dict[str, Mount]:
    """Return the sensor at each place of the experiment, by the name of the place."""
    space = evoros.compose([EXPERIMENT, "design.number=1"]).build().members[0].space
    genomes = (np.arange(len(space.regions)) + 0.5)[:, None] / len(space.regions)
    mounts = [space.decode(genome).mounts[0] for genome in genomes]
    return dict(zip(space.regions, mounts, strict=True))


def write_sets(places: Sequence[Mount], file: Path) -> None:
    """Write all sets of places as a table of designs, whose names are their numbers."""
    rows: list[dict[str, object]] = []
    for members in range(1 << len(places)):
        mounts = [places[i] for i in list_members(members)]
        rows += [
            {"design": members, "sensor": i, "x_m": m.x_m, "y_m": m.y_m, "yaw_deg": m.yaw_deg}
            for i, m in enumerate(mounts)
        ] or [{"design": members}]
    pd.DataFrame(rows).astype({"sensor": "Int64"}).to_csv(file, index=False)


@dataclass(frozen=True)
class Table:
    """The outcomes of each set without a failure, by its number and the world, in each trial."""

    places: Sequence[Mount]
    outcomes: Mapping[tuple[int, str], Sequence[Outcome]]

    @classmethod
    def read(cls, places: Sequence[Mount], missions: Sequence[pd.DataFrame]) -> "Table":
        """Read the missions of evaluations, one after another."""
        outcomes: dict[tuple[int, str], list[Outcome]] = {}
        for frame in missions:
            rows: Any = frame.sort_values("trial").itertuples()
            for row in rows:
                blank = Outcome.failure(row.ended, "", row.time_limit_s, row.sensors)
                known = {name: getattr(row, name) for name in ("completed", "progress", "time_s")}
                key = (int(row.design), str(row.world))
                outcomes.setdefault(key, []).append(replace(blank, **known))
        return cls(places, outcomes)

    @cached_property
    def trials(self) -> int:
        """The number of trials of each set in each world."""
        (count,) = {len(trials) for trials in self.outcomes.values()}
        return count

    @cached_property
    def scores(self) -> Array:
        """The score of each set in each trial, (trials, sets)."""
        worlds = {world for _, world in self.outcomes}
        scores = np.zeros((self.trials, 1 << len(self.places)))
        for members in range(scores.shape[1]):
            for world in sorted(worlds):
                scores[:, members] += list(map(equation_one, self.outcomes[members, world]))
        return scores

    @cached_property
    def completed(self) -> Array:
        """The share of completed missions of each set."""
        shares = np.zeros(1 << len(self.places))
        for (members, _), trials in self.outcomes.items():
            shares[members] += sum(outcome.completed for outcome in trials)
        return shares / (len(self.outcomes) / len(shares) * self.trials)

    def find_number(self, design: Design) -> int:
        """Return the number of a design's set."""
        return sum(1 << self.places.index(mount) for mount in design.mounts)


class BudgetSpent(Exception):
    """A search has had all its missions."""


class Tabulated(Recalled):
    """A journal of a search that has all missions, and notes the best of each generation.

    Beyond its budget of missions, a generation is not noted, and ends the search.
    """

    def __init__(self, experiment: Experiment, table: Table, budget: float = math.inf) -> None:
        super().__init__({})
        self._experiment, self._table, self._budget = experiment, table, budget
        self._known: dict[tuple[Mount, ...], tuple[list[int], Channels]] = {}
        self._trials: dict[str, int] = {}
        self.steps: list[tuple[int, int]] = []  # missions so far, and the best set by then

    def has(self, mission: Mission) -> bool:
        """Count the mission; all are known."""
        self.needed.add(mission.key)
        return True

    def find(self, mission: Mission) -> Outcomes:
        """Return the outcome of the sensors that survive."""
        places, channels = self._describe(mission.design)
        failure: Any = self._experiment.failure
        if mission.case is not None:
            faults = make_faults(failure, mission.case, len(places))
        else:
            faults = failure.draw(channels, generator(mission.draws, "failure"))
        failed = set(_list_failed([fault.onset for fault in faults]))
        number = sum(1 << place for i, place in enumerate(places) if i not in failed)
        if mission.draws not in self._trials:
            drawn = generator(mission.draws, "tabulated").integers(self._table.trials)
            self._trials[mission.draws] = int(drawn)
        return (self._table.outcomes[number, mission.world][self._trials[mission.draws]],)

    def _describe(self, design: Design) -> tuple[list[int], Channels]:
        """Return the place of each sensor, and the sensors as failures see them."""
        if design.mounts not in self._known:
            (member,) = self._experiment.scenario.equip(design)
            places = [self._table.places.index(mount) for mount in member.robot.mounts]
            self._known[design.mounts] = places, member.robot.describe_sensors()
        return self._known[design.mounts]

    def write_generation(self, generation: Generation) -> None:  # type: ignore[override]
        """Note the best design of a generation, and what it has cost.

        Raises:
            BudgetSpent: it has cost too much.
        """
        if len(self.needed) > self._budget:
            raise BudgetSpent
        design = self._experiment.space.decode(generation.best.individual.genome)
        self.steps.append((len(self.needed), self._table.find_number(design)))


def _list_failed(onsets: Sequence[Array]) -> Iterator[int]:
    for onset in onsets:
        if np.any((onset > 0) & np.isfinite(onset)):
            raise ValueError("failures must begin at 0 s; set failure.latest_s=0")
        yield from np.flatnonzero(onset == 0).tolist()
