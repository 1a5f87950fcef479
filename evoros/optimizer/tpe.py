"""The tree-structured Parzen estimator, which models the densities of good and other designs."""

import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import COUNT, checked
from evoros.base.errors import require_extra
from evoros.optimizer.history import FitnessSearch, History, draw_seed, list_categories, place_level
from evoros.optimizer.protocol import BundledOptimizer, Goals, Search, Space, require_genes

if TYPE_CHECKING:
    import optuna


@dataclass(frozen=True)
@checked
class Tpe(BundledOptimizer):
    """The multivariate tree-structured Parzen estimator, from the package ``optuna``.

    Regions and sensor types are categorical, and whole numbers are integers. The designs of a
    generation are proposed one by one, on the assumption that earlier designs of the generation
    have poor fitness. See J. Bergstra et al., "Algorithms for Hyper-Parameter Optimization", NIPS
    2011; S. Watanabe, "Tree-Structured Parzen Estimator", arXiv:2304.11127.
    """

    population_size: Annotated[int, COUNT] = 16
    random_first: Annotated[int, COUNT] = 16  # random designs at the start, at least a generation
    packages = ("optuna",)

    def start(self, space: Space, goals: Goals, rng: Generator) -> Search:
        require_genes(space)
        with require_extra("search", "optimizer=tpe"):
            import optuna
        logging.getLogger("optuna").setLevel(logging.WARNING)  # optuna logs every new study
        with _no_experiments():
            sampler = optuna.samplers.TPESampler(
                n_startup_trials=max(self.random_first, self.population_size),
                warn_independent_sampling=False,
                multivariate=True,
                constant_liar=True,
                seed=draw_seed(rng),
            )
        return FitnessSearch(_Study(self.population_size, space, sampler))


@contextmanager
def _no_experiments() -> Iterator[None]:
    from optuna.exceptions import ExperimentalWarning

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ExperimentalWarning)
        yield


class _Study:
    """An optuna study, rebuilt when an earlier fitness changes."""

    name = "tpe"

    def __init__(
        self, population_size: int, space: Space, sampler: "optuna.samplers.TPESampler"
    ) -> None:
        self._population_size, self._space, self._sampler = population_size, space, sampler
        self._categories = frozenset(list_categories(space))
        self._told: list[optuna.trial.FrozenTrial] = []  # indexed by individual id
        self._begin()

    def _begin(self) -> None:
        import optuna

        self._study = optuna.create_study(direction="maximize", sampler=self._sampler)

    def propose(self) -> list[Array]:
        self._trials = [self._study.ask() for _ in range(self._population_size)]
        return [self._suggest(trial) for trial in self._trials]

    def _suggest(self, trial: "optuna.Trial") -> Array:
        genome = np.zeros(self._space.size)
        for gene in range(self._space.size):
            name, count = f"{gene}", self._space.levels.get(gene)
            if count is None:
                genome[gene] = trial.suggest_float(name, 0.0, 1.0)
            elif gene in self._categories:
                level: Any = trial.suggest_categorical(name, list(range(count)))
                genome[gene] = place_level(int(level), count)
            else:
                genome[gene] = place_level(trial.suggest_int(name, 0, count - 1), count)
        return genome

    def learn(self, history: History, changed: bool) -> None:
        for trial, fitness in zip(self._trials, history.fitness, strict=True):
            self._study.tell(trial, fitness)
        self._told += self._study.get_trials(deepcopy=False)[-self._population_size :]
        if changed:
            self._rebuild(history)

    def _rebuild(self, history: History) -> None:
        self._begin()
        with _no_experiments():
            for index, told in enumerate(self._told):
                self._study.add_trial(_rescore(told, history.scores[index].fitness))
        self._told = list(self._study.get_trials(deepcopy=False))


def _rescore(trial: "optuna.trial.FrozenTrial", fitness: float) -> "optuna.trial.FrozenTrial":
    from optuna.trial import create_trial

    rescored: optuna.trial.FrozenTrial = create_trial(
        params=trial.params, distributions=trial.distributions, value=float(fitness)
    )
    return rescored
