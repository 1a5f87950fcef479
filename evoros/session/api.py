"""evoros in scripts and notebooks: what the commands do, as functions.

Example: an optimizer that is not ours drives the evaluation (any ask-tell library; here ``cma``).

    import cma
    import evoros

    if __name__ == "__main__":  # worker processes import this script
        with evoros.Evaluator(["failure=random", "trials=2"]) as evaluator:
            space = evaluator.space
            search = cma.CMAEvolutionStrategy(space.size * [0.5], 0.3, {"bounds": [0, 1]})
            for generation in range(10):
                genomes = search.ask()
                designs = [space.decode(genome) for genome in genomes]
                fitness = evaluator.score(designs, generation)
                search.tell(genomes, [-value for value in fitness])
                print(generation, max(fitness))
"""

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Self, TypeAlias

import pandas as pd

from evoros.base.errors import InputError
from evoros.config.compose import compose
from evoros.config.configuration import Configuration
from evoros.design.design import Design
from evoros.design.space import DesignSpace
from evoros.evolution.dispatch import Dispatcher
from evoros.evolution.experiment import Experiment
from evoros.executor.protocol import Pool
from evoros.fitness.scoring import fitness_of, scores
from evoros.mission.mission import Mission, MissionKey
from evoros.mission.outcome import Outcome
from evoros.session import run as session
from evoros.session.status import Display, NoDisplay
from evoros.storage.reading import Run, load_run
from evoros.storage.tables import MISSIONS_HEADER, mission_row

ConfigurationLike: TypeAlias = Configuration | Sequence[str]
"""A composed configuration, or the overrides that one would type behind ``evoros``."""


def run(config: ConfigurationLike, folder: str | Path, display: Display | None = None) -> Run:
    """Evolve as the command ``evoros`` does, into a new or empty folder.

    Raises:
        InputError: something cannot be used; nothing was changed.
        RunStopped: a mission was lost; ``resume(folder)`` goes on.
    """
    session.create_run(_compose(config), Path(folder)).run(display or NoDisplay())
    return load_run(folder)


def resume(
    folder: str | Path,
    overrides: Sequence[str] = (),
    display: Display | None = None,
    config_dir: str | Path | None = None,
) -> Run:
    """Go on with a run, as ``evoros resume=FOLDER`` does.

    ``config_dir`` is the folder of your own parts, as with ``compose`` when the run was started.

    Raises:
        InputError: no run there, or an override that resuming does not accept.
        RunStopped: a mission was lost.
    """
    session.open_run(Path(folder), overrides, config_dir).run(display or NoDisplay())
    return load_run(folder)


def evaluate(
    designs: Sequence[Design], config: ConfigurationLike, generation: int = 0
) -> pd.DataFrame:
    """Score designs under draws that no run is selected on: a row for each design.

    Columns: design (its position), fitness_mean, fitness_sd (over the trials, NaN for one),
    trials, and for each world the share completed and the mean progress. For many calls keep an
    ``Evaluator`` open instead: it keeps its workers.
    """
    with Evaluator(config) as evaluator:
        return evaluator.evaluate(designs, generation)


class Evaluator:
    """Scores designs with workers that stay; a context manager.

    ``config.trials``, the worlds, the failure and so on are those of the configuration; its
    optimizer is not used.
    """

    def __init__(self, config: ConfigurationLike) -> None:
        self.experiment: Experiment = _compose(config).build()
        session.check_experiment(self.experiment)
        self._stack = ExitStack()
        self._pool: Pool | None = None

    @property
    def space(self) -> DesignSpace:
        """Decodes vectors of the unit cube, (space.size,), into designs."""
        return self.experiment.space

    def __enter__(self) -> Self:
        self._pool = self._stack.enter_context(self.experiment.executor.open())
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._pool = None
        self._stack.__exit__(kind, error, trace)

    def score(self, designs: Sequence[Design], generation: int = 0) -> list[float]:
        """The fitness of each design. Another ``generation`` means fresh random draws.

        Raises:
            InputError: a design cannot be built, or the evaluator is not open.
            RunStopped: a mission was lost.
        """
        missions, outcomes = self._fly(designs, generation)
        fitness = self.experiment.fitness
        return [fitness_of(fitness, each, outcomes) for each in missions]

    def evaluate(self, designs: Sequence[Design], generation: int = 0) -> pd.DataFrame:
        """The table that the function ``evaluate`` returns."""
        missions, outcomes = self._fly(designs, generation)
        rows = [
            {"design": i} | scores(self.experiment.fitness, each, outcomes)
            for i, each in enumerate(missions)
        ]
        return pd.DataFrame(rows)

    def missions(self, designs: Sequence[Design], generation: int = 0) -> pd.DataFrame:
        """A row for each mission, with the columns of a run's ``missions.csv``."""
        missions, outcomes = self._fly(designs, generation)
        rows = [mission_row(m, outcomes[m.key]) for each in missions for m in each]
        return pd.DataFrame(rows, columns=list(MISSIONS_HEADER))

    def _fly(
        self, designs: Sequence[Design], generation: int
    ) -> tuple[list[list[Mission]], dict[MissionKey, Outcome]]:
        if self._pool is None:
            raise InputError(
                "Evaluator: must be open; use it as `with Evaluator(...) as evaluator:`"
            )
        experiment = self.experiment
        for design in designs:  # made by hand, maybe: what is wrong is said and not scored
            experiment.scenario.with_design(design)
        missions = [
            experiment.plan.evaluation(generation, i, design) for i, design in enumerate(designs)
        ]
        wanted = [mission for each in missions for mission in each]
        workers, lost = experiment.executor.workers, experiment.lost_missions
        batches = Dispatcher(self._pool, workers, lost).run(experiment.scenario, wanted)
        return missions, {mission.key: outcome for batch in batches for mission, outcome in batch}


def _compose(config: ConfigurationLike) -> Configuration:
    return config if isinstance(config, Configuration) else compose(list(config))


__all__ = ["Evaluator", "Run", "evaluate", "load_run", "resume", "run"]
