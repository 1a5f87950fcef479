"""The evolution of designs: ask, evaluate, tell, record."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from statistics import fmean

from evoros.base.errors import InputError
from evoros.base.rng import generator
from evoros.design.design import Design
from evoros.evolution.dispatch import Dispatcher
from evoros.evolution.experiment import Experiment
from evoros.evolution.journal import Generation, Observer
from evoros.executor.protocol import Pool
from evoros.fitness.scoring import fitness_of
from evoros.mission.mission import Mission
from evoros.mission.plan import CONFIRMATION, SELECTION, VALIDATION
from evoros.optimizer.protocol import Candidate
from evoros.storage.run_folder import RunFolder
from evoros.storage.tables import (
    LOSS,
    SCREENED,
    VALIDATED,
    design_table,
    gene_table,
    generation_table,
    trajectory_table,
)


@dataclass
class Evolution:
    """A run in progress: the experiment, its folder, and what the search has found so far."""

    experiment: Experiment
    folder: RunFolder
    observer: Observer
    generations: int
    screened: dict[int, float] = field(default_factory=dict)  # fitness by individual
    confirmed: dict[int, float] = field(default_factory=dict)  # fitness by individual
    validated: dict[int, float] = field(default_factory=dict)  # fitness by individual
    born: dict[int, int] = field(default_factory=dict)  # generation by individual

    def run(self, pool: Pool) -> Generation:
        """Evolve to the last generation and record the champion; replays what is on disk."""
        experiment = self.experiment
        search = experiment.optimizer.start(
            experiment.space, generator(f"{experiment.seed}", "optimizer")
        )
        for number in range(self.generations):
            individuals = search.ask()
            self.born.update({one.id: number for one in individuals})
            designs = {one.id: experiment.space.decode(one.genome) for one in individuals}
            candidates = search.tell(self._evaluate(number, designs, pool))
            generation = self._conclude(number, candidates, pool)
        self._record_champion(generation.best, pool)
        return generation

    def _evaluate(self, number: int, designs: Mapping[int, Design], pool: Pool) -> list[float]:
        """The fitness of each new design: the confirmed one where there is one."""
        plan, confirmation = self.experiment.plan, self.experiment.confirmation
        screened = self._score(number, designs, SELECTION, plan.selection, pool)

        def confirm(best: Sequence[int]) -> dict[int, float]:
            chosen = {one: designs[one] for one in best}
            return self._score(number, chosen, CONFIRMATION, plan.confirmation, pool)

        confirmed = confirmation.settle(screened, confirm) if confirmation else {}
        self.screened.update(screened)
        self.confirmed.update(confirmed)
        return [confirmed.get(one, screened[one]) for one in designs]

    def _score(
        self,
        number: int,
        designs: Mapping[int, Design],
        purpose: str,
        plan: Callable[[int, int, Design], list[Mission]],
        pool: Pool,
    ) -> dict[int, float]:
        """The fitness of each design: from disk where it is known, else flown and recorded."""
        experiment, folder = self.experiment, self.folder
        missions = {one: plan(number, one, design) for one, design in designs.items()}
        wanted = [mission for each in missions.values() for mission in each]
        self.observer.begin(number, len(wanted), sum(map(folder.has, wanted)))
        dispatcher = Dispatcher(pool, experiment.executor.workers, experiment.lost_missions)
        scenario = experiment.scenario_for(purpose)
        dispatcher.run_missing(scenario, wanted, folder, self.observer.mission)
        known = {place: outcome for place, (_, outcome) in folder.outcomes.items()}
        return {one: fitness_of(experiment.fitness, each, known) for one, each in missions.items()}

    def _conclude(self, number: int, candidates: Sequence[Candidate], pool: Pool) -> Generation:
        """Validate the generation's best and record the generation."""
        best = self._best(candidates)
        one, space, plan = best.individual, self.experiment.space, self.experiment.plan
        if plan.validation_trials and one.id not in self.validated:
            designs = {one.id: space.decode(one.genome)}
            self.validated |= self._score(number, designs, VALIDATION, plan.validation, pool)
        genes = [space.values(candidate.individual.genome) for candidate in candidates]
        table = generation_table(number, candidates, self._measured(), genes)
        self.folder.write_generation(number, table)
        self.folder.sync()
        mean = fmean(candidate.fitness for candidate in candidates)
        validated = self.validated.get(one.id)
        generation = Generation(number, candidates, best, validated, mean, self._losses())
        self.observer.generation(generation)
        return generation

    def _best(self, candidates: Sequence[Candidate]) -> Candidate:
        """The fittest, of the confirmed ones if there are any.

        A search that may lose its best so far keeps others that were never confirmed.
        """
        return max(
            candidates, key=lambda each: (each.individual.id in self.confirmed, each.fitness)
        )

    def _losses(self) -> dict[int, float]:
        """What the confirming simulator took from each design that it scored."""
        return {one: self.screened[one] - fitness for one, fitness in self.confirmed.items()}

    def _measured(self) -> dict[str, Mapping[int, float]]:
        """The columns of a generation's table that have a number for some of its candidates."""
        if self.experiment.confirmation is None:
            return {VALIDATED: self.validated}
        return {VALIDATED: self.validated, SCREENED: self.screened, LOSS: self._losses()}

    def _record_champion(self, best: Candidate, pool: Pool) -> None:
        """The design, its robot and its first mission in each world, flown again, and the worlds.

        It is one of those that gave it its fitness: confirmed, where there is a confirmation.
        """
        experiment, one = self.experiment, best.individual
        design = experiment.space.decode(one.genome)
        scenario, plan = experiment.scenario, experiment.plan.selection
        if experiment.confirmation:
            scenario, plan = experiment.confirming, experiment.plan.confirmation
        missions = plan(self.born[one.id], one.id, design)
        first = missions[: len(experiment.world)]
        names = {gene.key: name for name, gene in experiment.design.genes.items()}
        files = {"genes.csv": gene_table(one.id, design, names)}
        with suppress(InputError):  # no design of the run could be built, and so this one neither
            files["robot.urdf"] = experiment.scenario.with_design(design).robot.urdf
        worlds = {each.world: scenario.world[each.world].at(each.draws) for each in first}
        files |= {f"world_{name}.sdf": world.sdf for name, world in worlds.items()}
        files["design.csv"] = design_table({one.id: design})
        tracks = [f"trajectory_{mission.world}.csv" for mission in first]
        if self.folder.has_champion(files, tracks):
            return
        dispatcher = Dispatcher(pool, experiment.executor.workers, experiment.lost_missions)
        flown = dispatcher.run_for_trajectories(scenario, first)
        tables = map(trajectory_table, flown)
        self.folder.write_champion({**dict(zip(tracks, tables, strict=True)), **files})
