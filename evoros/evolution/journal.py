"""The reports of an evolution (missions, generations, champion), and who takes them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from statistics import fmean
from typing import Protocol

from evoros.base.arrays import Array
from evoros.certificate.certificate import Certificate
from evoros.design.design import Design
from evoros.dispatch.record import MissionRecord
from evoros.mission.mission import Mission
from evoros.mission.outcome import Outcomes
from evoros.mission.scenario import Scenario
from evoros.optimizer.protocol import Candidate
from evoros.robot.model import Robot
from evoros.world.model import World


@dataclass(frozen=True)
class Generation:
    """A finished generation. Each mapping is by the individual."""

    number: int
    candidates: Sequence[Candidate]
    genes: Sequence[Mapping[str, object]]  # the values of each candidate, by name
    measures: Sequence[Mapping[str, float]]  # objectives and descriptors of each candidate
    best: Candidate
    trials: Mapping[int, int]  # how many the fitness of each candidate combines
    validated_fitness: Mapping[int, float]  # of the best of each generation so far
    screened_fitness: Mapping[int, float]  # of each candidate; empty without a confirmation
    losses: Mapping[int, float]  # screened minus confirmed fitness of all that were confirmed

    @cached_property
    def mean(self) -> float:
        """The mean fitness of the candidates."""
        return fmean(candidate.fitness for candidate in self.candidates)

    @property
    def validated(self) -> float | None:
        """The validated fitness of the best; None without validation trials."""
        return self.validated_fitness.get(self.best.individual.id)

    @property
    def loss(self) -> float | None:
        """The loss of the best; None if it was not confirmed."""
        return self.losses.get(self.best.individual.id)

    @property
    def mean_loss(self) -> float | None:
        """The mean loss of all confirmed individuals; None without a confirmation."""
        return fmean(self.losses.values()) if self.losses else None

    @property
    def summary(self) -> str:
        """The fitness of the best, its validated fitness and loss, and the mean, for messages."""
        validated = "" if self.validated is None else f", validated {self.validated:.3f}"
        loss = "" if self.loss is None else f", loss {self.loss:.3f}"
        return f"best {self.best.fitness:.3f}{validated}{loss}, mean {self.mean:.3f}"


@dataclass(frozen=True)
class Champion:
    """The best design of a run, and the worlds of its first mission in each of them."""

    id: int
    design: Design
    gene_names: Mapping[str, Mapping[str, str]]  # by the robot and the key in ``design.values``
    robots: Mapping[str, Robot]
    """By name, with sensors and values. None if a part refuses these."""
    worlds: Mapping[str, World]  # by name
    tracks: Sequence[str]  # names of the worlds whose trajectories are kept
    columns: Mapping[str, Sequence[str]]  # of a trajectory in each world
    certificate: Certificate


@dataclass(frozen=True)
class Ending:
    """How a run ended."""

    last: Generation
    certificate: Certificate  # of the champion


@dataclass(frozen=True)
class Champions:
    """The designs of a finished search, the best first: one, a front or an archive."""

    designs: Mapping[int, Design]  # by the individual
    scores: Sequence[Mapping[str, float]]  # fitness, objectives and descriptors of each
    gene_names: Mapping[str, Mapping[str, str]]  # as in a ``Champion``


class Watcher(Protocol):
    """Watches a run. No result depends on it."""

    def begin(self, generation: int, missions: int, known: int) -> None:
        """Note that ``missions`` are needed next, of which ``known`` are recorded already."""

    def mission(self, mission: Mission, outcomes: Outcomes) -> None:
        """Note a mission that was run and recorded."""

    def generation(self, generation: Generation) -> None:
        """Note a generation that is recorded."""


class Journal(MissionRecord, Protocol):
    """Keeps a run. An evolution that finds its missions here does not run them again."""

    def find(self, mission: Mission) -> Outcomes | None:
        """Return the recorded outcomes of a mission; None if there are none.

        Raises:
            InputError: the mission was recorded under other draws.
        """

    def write_generation(self, generation: Generation) -> None:
        """Record a generation.

        Raises:
            InputError: the journal has the generation, and it differs.
        """

    def keep_trajectory(self, scenario: Scenario, mission: Mission, trajectory: Array) -> None:
        """Keep the trajectory of a mission that was run, before it is recorded."""

    def read_trajectory(self, mission: Mission) -> Array:
        """Return the trajectory of a mission, which was kept."""

    def drop_trajectories(self, missions: Sequence[Mission]) -> list[Mission]:
        """Drop the trajectories of all other missions; return the missions that have none."""

    def write_champions(self, champions: Champions) -> None:
        """Record these designs in place of any others, if there are several."""

    def has_champion(self, champion: Champion) -> bool:
        """Whether the journal has this champion, with its trajectories."""

    def write_champion(self, champion: Champion, trajectories: Mapping[str, Array]) -> None:
        """Record the champion in place of any other, with a trajectory for each of its tracks."""
