"""The evolution of designs: ask, evaluate, tell, record."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Protocol

import numpy as np

from evoros.chain import localization_chain, sensor_chain, sensor_channels
from evoros.design import DesignSpace, SensorDesign
from evoros.errors import COUNT, NAME, WHOLE, InputError, check, instance_of, one_of
from evoros.evaluation import POLICIES, STOP, WORST, Plan, compute, fitness_of, trajectories
from evoros.fitness import Fitness
from evoros.genes import check_genes
from evoros.mission import Mission
from evoros.outcome import Outcome
from evoros.record import RunFolder
from evoros.rng import generator
from evoros.robot import Robot
from evoros.search import Candidate, Optimizer
from evoros.tables import design_table, gene_table, generation_table, trajectory_table
from evoros.task import Task
from evoros.types import POSE_SIZE, Controller, Design, Executor, Failure, Pool, Simulator
from evoros.world import Course, World


@dataclass(frozen=True)
class Experiment:
    """All that a run is: a pure function from this to a run folder.

    The field names are the keys and groups of ``conf/config.yaml``.

    Raises:
        InputError: a value out of range, a part of the wrong kind, parts that do not fit.
    """

    robot: Robot
    world: Mapping[str, World]
    design: SensorDesign
    failure: Failure
    controller: Controller
    simulator: Simulator
    fitness: Fitness
    optimizer: Optimizer
    executor: Executor
    seed: int = 0
    trials: int = 1  # missions of a design in each world
    draws: str = "generation"  # who meets the same random draws: generation, individual or run
    lost_missions: str = STOP  # a mission that crashes or hangs: stop the run, or worst
    course: Course | None = None  # to whose values those of the worlds' courses may refer

    def __post_init__(self) -> None:
        check(
            self,
            fitness=instance_of(Fitness, "a fitness (score and worst)"),
            optimizer=instance_of(Optimizer, "an optimizer (generations and start)"),
            executor=instance_of(Executor, "an executor (workers and open)"),
            seed=WHOLE,
            trials=COUNT,
            draws=one_of(*POLICIES),
            lost_missions=one_of(STOP, WORST),
            course=instance_of(Course | None, "a course (evoros.world.Course)"),
        )
        parts = {"robot": self.robot, "controller": self.controller, "design": self.design}
        check_genes(self.task.design.genes, parts)
        for name in self.world:
            if not NAME.holds(name):
                raise InputError(
                    f"world: the key of each world must be {NAME.text}, not {name!r}; rename it"
                )
        self._try_out()

    def _try_out(self) -> None:
        """All that a mission needs before its engine, once: a run must not break in its middle.

        The design lies in the middle of the search space, with a sensor of each type.
        """
        rng = partial(generator, "try out")
        _ = self.optimizer.start(self.space, rng("optimizer"))
        middle = self.space.decode(np.full(self.space.size, 0.5))
        places = middle.mounts[:1]  # none where no sensors are placed
        mounts = tuple(replace(at, sensor=name) for at in places for name in self.design.sensors)
        task = self.task.embody(Design(mounts, middle.values))
        faults = self.failure.draw(sensor_channels(task.robot), rng("failure"))
        values, tick = np.zeros(len(mounts)), self.simulator.time_step
        sensor_chain(task.robot, faults, values, values, tick, rng)
        controller, pose = task.controller, np.zeros(POSE_SIZE)
        localization_chain(controller.localization, pose, controller.period_s, rng)
        try:
            with controller.open(task.robot, rng):
                pass
        except InputError as error:
            raise InputError(f"controller: {error}") from None

    @cached_property
    def task(self) -> Task:
        """What a mission needs of the experiment."""
        return Task(
            self.robot, self.world, self.design, self.failure, self.controller, self.simulator
        )

    @cached_property
    def space(self) -> DesignSpace:
        """The search space."""
        return self.design.space(self.robot)

    @cached_property
    def plan(self) -> Plan:
        """Which missions score a design."""
        return Plan(
            self.seed,
            tuple(self.world),
            self.trials,
            self.optimizer.validation_trials,
            self.draws,
        )


@dataclass(frozen=True)
class Generation:
    """What is known when a generation is over."""

    number: int
    candidates: Sequence[Candidate]
    best: Candidate
    validated: float | None  # of the best; None without validation trials
    mean: float  # fitness of the candidate pool

    @property
    def standing(self) -> str:
        """Best fitness, recorded and validated, and mean, for messages."""
        validated = "" if self.validated is None else f", validated {self.validated:.3f}"
        return f"best {self.best.fitness:.3f}{validated}, mean {self.mean:.3f}"


class Observer(Protocol):
    """Watches a run; nothing depends on it."""

    def begin(self, generation: int, missions: int, known: int) -> None:
        """So many missions are wanted next, of which so many are on disk already."""
        ...

    def mission(self, mission: Mission, outcome: Outcome) -> None:
        """A mission was flown and is on disk."""
        ...

    def generation(self, generation: Generation) -> None:
        """A generation is over and on disk."""
        ...


@dataclass
class Evolution:
    """A run in progress: the experiment, its folder, and what the search has found so far."""

    experiment: Experiment
    folder: RunFolder
    observer: Observer
    generations: int
    validated: dict[int, float] = field(default_factory=dict)  # fitness by individual
    born: dict[int, int] = field(default_factory=dict)  # generation by individual

    def run(self) -> Generation:
        """Evolve to the last generation and record the champion; replays what is on disk."""
        experiment = self.experiment
        search = experiment.optimizer.start(
            experiment.space, generator(f"{experiment.seed}", "optimizer")
        )
        with experiment.executor.open() as pool:
            for number in range(self.generations):
                individuals = search.ask()
                self.born.update({one.id: number for one in individuals})
                designs = {one.id: experiment.space.decode(one.genome) for one in individuals}
                fitness = self._score(number, designs, experiment.plan.selection, pool)
                candidates = search.tell(fitness)
                generation = self._conclude(number, candidates, pool)
            self._record_champion(generation.best, pool)
        return generation

    def _score(
        self,
        number: int,
        designs: Mapping[int, Design],
        plan: Callable[[int, int, Design], list[Mission]],
        pool: Pool,
    ) -> list[float]:
        """The fitness of each design: from disk where it is known, else flown and recorded."""
        experiment, folder = self.experiment, self.folder
        missions = {name: plan(number, name, design) for name, design in designs.items()}
        wanted = [mission for each in missions.values() for mission in each]
        missing = [mission for mission in wanted if folder.find(mission) is None]
        self.observer.begin(number, len(wanted), len(wanted) - len(missing))
        workers, lost = experiment.executor.workers, experiment.lost_missions
        for mission, outcome in compute(experiment.task, missing, pool, workers, lost):
            folder.record(mission, outcome)
            self.observer.mission(mission, outcome)
        known = {place: outcome for place, (_, outcome) in folder.outcomes.items()}
        return [fitness_of(experiment.fitness, each, known) for each in missions.values()]

    def _conclude(self, number: int, candidates: Sequence[Candidate], pool: Pool) -> Generation:
        """Validate the generation's best and record the generation."""
        space = self.experiment.space
        best = max(candidates, key=lambda candidate: candidate.fitness)
        one = best.individual
        if self.experiment.plan.validation_trials and one.id not in self.validated:
            designs = {one.id: space.decode(one.genome)}
            (score,) = self._score(number, designs, self.experiment.plan.validation, pool)
            self.validated[one.id] = score
        genes = [space.values(candidate.individual.genome) for candidate in candidates]
        table = generation_table(number, candidates, self.validated, genes)
        self.folder.write_generation(number, table)
        self.folder.sync()
        mean = sum(candidate.fitness for candidate in candidates) / len(candidates)
        generation = Generation(number, candidates, best, self.validated.get(one.id), mean)
        self.observer.generation(generation)
        return generation

    def _record_champion(self, best: Candidate, pool: Pool) -> None:
        """The design, its robot and its first selection mission in each world, flown again."""
        experiment, one = self.experiment, best.individual
        design = experiment.space.decode(one.genome)
        missions = experiment.plan.selection(self.born[one.id], one.id, design)
        first = missions[: len(experiment.world)]
        names = {gene.key: name for name, gene in experiment.design.genes.items()}
        files = {"genes.csv": gene_table(one.id, design, names)}
        with suppress(InputError):  # no design of the run could be built, and so this one neither
            files["robot.urdf"] = experiment.task.embody(design).robot.urdf
        files["design.csv"] = design_table({one.id: design})
        tracks = [f"trajectory_{mission.world}.csv" for mission in first]
        if self.folder.has_champion(files, tracks):
            return
        flown = trajectories(experiment.task, first, pool, experiment.lost_missions)
        tables = map(trajectory_table, flown)
        self.folder.write_champion({**dict(zip(tracks, tables, strict=True)), **files})
