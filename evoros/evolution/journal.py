"""The records of an evolution (missions, generations, champion), and their receivers."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from statistics import fmean
from typing import Protocol

from evoros.base.arrays import Array
from evoros.certificate.certificate import Certificate
from evoros.design.design import Design
from evoros.dispatch.dispatcher import MissionRecord
from evoros.mission.mission import Mission, Outcomes
from evoros.mission.scenario import Scenario
from evoros.optimizer.protocol import Candidate
from evoros.robot.model import Robot
from evoros.world.model import World


@dataclass(frozen=True)
class Generation:
    """A finished generation; mappings are keyed by individual."""

    number: int
    candidates: Sequence[Candidate]
    genes: Sequence[Mapping[str, object]]  # gene values of each candidate by name
    measures: Sequence[Mapping[str, float]]  # objectives and descriptors of each candidate
    best: Candidate
    trials: Mapping[int, int]  # number of trials in the fitness of each candidate
    validated_fitness: Mapping[int, float]  # the best designs of all generations so far
    screened_fitness: Mapping[int, float]  # all candidates; empty if the run has no confirmation
    losses: Mapping[int, float]  # screened minus confirmed fitness of confirmed individuals

    @cached_property
    def mean(self) -> float:
        """The mean fitness of the candidates."""
        return fmean(candidate.fitness for candidate in self.candidates)

    @property
    def validated(self) -> float | None:
        """The validated fitness of the best candidate; None if it was not validated."""
        return self.validated_fitness.get(self.best.individual.id)

    @property
    def loss(self) -> float | None:
        """The loss of the best candidate; None if not confirmed."""
        return self.losses.get(self.best.individual.id)

    @property
    def mean_loss(self) -> float | None:
        """The mean loss of confirmed individuals; None if there are none."""
        return fmean(self.losses.values()) if self.losses else None

    @property
    def summary(self) -> str:
        """Fitness, validated fitness and loss of the best candidate, and the mean, as text."""
        validated = "" if self.validated is None else f", validated {self.validated:.3f}"
        loss = "" if self.loss is None else f", loss {self.loss:.3f}"
        return f"best {self.best.fitness:.3f}{validated}{loss}, mean {self.mean:.3f}"


@dataclass(frozen=True)
class Champion:
    """The best design of a run, and the worlds of its first missions."""

    id: int
    design: Design
    gene_names: Mapping[str, Mapping[str, str]]  # robot -> key in ``design.values`` -> gene name
    robots: Mapping[str, Robot]  # equipped robots by name; empty if a part rejects the values
    worlds: Mapping[str, World]
    tracks: Sequence[str]  # names of worlds with kept trajectories
    columns: Mapping[str, Sequence[str]]  # columns of the trajectory in each world
    certificate: Certificate


@dataclass(frozen=True)
class Ending:
    """The last generation of a run, and the certificate of its champion."""

    last: Generation
    certificate: Certificate


@dataclass(frozen=True)
class Champions:
    """The best design, front or archive of a finished search, best first."""

    designs: Mapping[int, Design]  # keyed by individual id
    scores: Sequence[Mapping[str, float]]  # fitness, objectives and descriptors of each design
    gene_names: Mapping[str, Mapping[str, str]]  # see ``Champion``


class Watcher:
    """Follows the progress of a run without affecting its results."""

    def begin(self, generation: int, missions: int, known: int) -> None:
        """Report the start of ``missions`` missions, of which ``known`` are already recorded."""

    def mission(self, mission: Mission, outcomes: Outcomes) -> None:
        """Report that a mission has finished and has been recorded."""

    def generation(self, generation: Generation) -> None:
        """Report that a generation has been recorded."""


class Journal(MissionRecord, Protocol):
    """Keeps the records of a run, so that the evolution repeats no recorded missions."""

    def find(self, mission: Mission) -> Outcomes | None:
        """Return the recorded outcomes of a mission, or None; InputError for different draws."""

    def keep_log(self, mission: Mission, log: str) -> None:
        """Store the output of the controller in a lost mission."""

    def write_generation(self, generation: Generation) -> None:
        """Record a generation; raise an InputError if it differs from the recorded one."""

    def keep_trajectory(self, scenario: Scenario, mission: Mission, trajectory: Array) -> None:
        """Store the trajectory of a finished mission, before recording the mission."""

    def read_trajectory(self, mission: Mission) -> Array:
        """Return the stored trajectory of a mission."""

    def drop_trajectories(self, missions: Sequence[Mission]) -> list[Mission]:
        """Delete all trajectories except for ``missions``; return the missions that have none."""

    def write_champions(self, champions: Champions) -> None:
        """Replace the recorded champions, if the run has or had several."""

    def has_champion(self, champion: Champion) -> bool:
        """Return True if this champion is recorded with all trajectories."""

    def write_champion(self, champion: Champion, trajectories: Mapping[str, Array]) -> None:
        """Replace the recorded champion, with a trajectory for each name in ``tracks``."""
