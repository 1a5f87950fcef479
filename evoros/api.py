"""The Python interface of evoros: its commands as functions for scripts and notebooks.

Example: evaluate the designs of an ask-and-tell optimizer, here ``cma``.

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

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, nullcontext
from itertools import chain
from pathlib import Path
from typing import Any, Self

import pandas as pd

from evoros.analysis.run_figures import check_figures, draw_figure
from evoros.base.errors import InputError
from evoros.config.compose import compose
from evoros.config.configuration import Configuration
from evoros.design.design import Design
from evoros.design.team import TeamSpace
from evoros.dispatch.dispatcher import Dispatcher
from evoros.evolution.experiment import Experiment
from evoros.executor.protocol import Pool
from evoros.mission.mission import Mission, MissionKey, Outcomes
from evoros.preflight.preflight import preflight
from evoros.session.controls import run as run_with_controls
from evoros.session.progress import Progress
from evoros.session.run import create_run, open_run
from evoros.session.status import Display
from evoros.storage.reading import Run, ScoredDesigns, load_run
from evoros.storage.tables import (
    MISSION_COLUMNS,
    list_further_in,
    mission_row,
    name_outcome_columns,
)


def run(
    config: Configuration | Sequence[str],
    folder: str | Path,
    *,
    config_dir: str | Path | None = None,
    display: Display | None = None,
) -> Run:
    """Evolve like the command ``evoros``, into a new or empty folder, and return the run.

    ``config`` is a composed configuration, or the overrides of the command; ``config_dir`` is the
    folder with your own parts, to which overrides may refer. The default ``display`` is a line of
    progress on standard error, or below a notebook cell; ``NoDisplay()`` shows nothing.

    Raises:
        InputError: the input cannot be used; nothing was changed.
        RunStopped: a mission was lost; ``resume(folder)`` resumes the run.
    """
    with _show(display) as shown:
        run_with_controls(
            create_run(_compose(config, config_dir), Path(folder)), shown, draw_figure
        )
    return load_run(folder)


def resume(
    folder: str | Path,
    overrides: Sequence[str] = (),
    *,
    config_dir: str | Path | None = None,
    display: Display | None = None,
) -> Run:
    """Resume a run like ``evoros resume FOLDER``, and return it.

    ``overrides`` may change the executor and raise ``optimizer.generations``. The other arguments
    are as in ``run``; ``config_dir`` must contain the same parts as when the run started.

    Raises:
        InputError: the folder has no run, or an override cannot be applied to the run.
        RunStopped: a mission was lost.
    """
    with _show(display) as shown:
        run_with_controls(open_run(Path(folder), overrides, config_dir), shown, draw_figure)
    return load_run(folder)


def evaluate(
    config: Configuration | Sequence[str],
    designs: Sequence[Design],
    generation: int = 0,
    *,
    config_dir: str | Path | None = None,
    display: Display | None = None,
) -> ScoredDesigns:
    """Score designs on draws never used for selection; return a table, one row per design.

    Columns: design (its index), fitness_mean, fitness_sd (over the trials; NaN for one trial),
    trials, and for each world WORLD_completed (fraction of the trials) and WORLD_progress (mean).
    The attribute ``missions`` is the table of ``Evaluator.missions``. A different ``generation``
    gives fresh random draws. Other arguments are as in ``run``. Use an ``Evaluator`` for repeated
    calls.

    Raises:
        InputError: the configuration or a design cannot be used.
        RunStopped: a mission was lost.
    """
    with Evaluator(config, config_dir=config_dir, display=display) as evaluator:
        return evaluator.evaluate(designs, generation)


class Evaluator:
    """A context manager that scores designs with the same workers in each call.

    The configuration's optimizer is ignored. Arguments are as in ``run``. The evaluator's methods
    display progress. A configuration that cannot be used raises an InputError.
    """

    def __init__(
        self,
        config: Configuration | Sequence[str],
        *,
        config_dir: str | Path | None = None,
        display: Display | None = None,
    ) -> None:
        self._display = display
        with _show(display):
            self.experiment: Experiment = _compose(config, config_dir).build()
            preflight(self.experiment)
        self._stack = ExitStack()
        self._pool: Pool | None = None

    @property
    def space(self) -> TeamSpace:
        """The space that decodes vectors (space.size,) in the unit cube into designs."""
        return self.experiment.space

    def __enter__(self) -> Self:
        self._pool = self._stack.enter_context(self.experiment.executor.open())
        return self

    def __exit__(self, *details: Any) -> None:
        self._pool = None
        self._stack.__exit__(*details)

    def score(self, designs: Sequence[Design], generation: int = 0) -> list[float]:
        """Return the fitness of each design; a different ``generation`` gives fresh random draws.

        Raises an InputError for a design that cannot be built, a RunStopped for a lost mission.
        """
        missions, outcomes = self._run(designs, generation)
        scoring = self.experiment.scoring
        return [scoring.compute_fitness(of_design, outcomes) for of_design in missions]

    def evaluate(self, designs: Sequence[Design], generation: int = 0) -> ScoredDesigns:
        """Score designs and return a table as ``evoros.evaluate`` does."""
        missions, outcomes = self._run(designs, generation)
        rows = [
            {"design": i} | self.experiment.scoring.summarize(of_design, outcomes)
            for i, of_design in enumerate(missions)
        ]
        scored = ScoredDesigns(rows)
        scored.missions = self._tabulate(missions, outcomes)
        return scored

    def missions(self, designs: Sequence[Design], generation: int = 0) -> pd.DataFrame:
        """Run the missions of designs and return a table with the columns of ``missions.csv``."""
        return self._tabulate(*self._run(designs, generation))

    def _tabulate(
        self, missions: Sequence[Sequence[Mission]], outcomes: Mapping[MissionKey, Outcomes]
    ) -> pd.DataFrame:
        further = list_further_in(self.experiment.scenario)
        flat = chain.from_iterable(missions)
        rows = [mission_row(mission, outcomes[mission.key], further=further) for mission in flat]
        columns = [*MISSION_COLUMNS, *name_outcome_columns(self.experiment.agents, further)]
        return pd.DataFrame(rows, columns=columns)

    def _run(
        self, designs: Sequence[Design], generation: int
    ) -> tuple[list[list[Mission]], dict[MissionKey, Outcomes]]:
        if isinstance(designs, str | Path):
            raise InputError(
                f"designs: must be a list of designs, not {designs}; to score the designs in a "
                f"folder, use evoros evaluate designs=FOLDER"
            )
        if self._pool is None:
            raise InputError(
                "Evaluator: must be open; use it as `with Evaluator(...) as evaluator:`"
            )
        experiment = self.experiment
        designs = list(map(experiment.space.complete, designs))
        for design in designs:  # an invalid design raises an error here rather than during scoring
            experiment.scenario.equip(design)
        missions = [
            experiment.plan.evaluation(generation, i, design) for i, design in enumerate(designs)
        ]
        needed = list(chain.from_iterable(missions))
        scenario = experiment.scenario_for(experiment.evaluation_draws)
        batches = Dispatcher(self._pool, experiment.lost_missions).run(scenario, needed)
        outcomes: dict[MissionKey, Outcomes] = {}
        with _show(self._display) as display:
            display.start(1)
            display.begin(0, len(needed), 0)
            for mission, of_mission in chain.from_iterable(batches):
                outcomes[mission.key] = of_mission
                display.mission(mission, of_mission)
        return missions, outcomes


def _show(display: Display | None) -> AbstractContextManager[Display]:
    return Progress() if display is None else nullcontext(display)


def _compose(config: Configuration | Sequence[str], config_dir: str | Path | None) -> Configuration:
    if not isinstance(config, Configuration):
        composed = compose(list(config), config_dir=config_dir)
    elif config_dir is None:
        composed = config
    else:
        raise InputError(
            f"config_dir={config_dir}: cannot be combined with a composed configuration; pass the "
            f"folder to evoros.compose"
        )
    check_figures(composed.values)
    return composed
