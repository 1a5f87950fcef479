"""NSGA-II, a multi-objective search."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated

import numpy as np
from numpy.random import Generator

from evoros.base.checks import COUNT, POSITIVE, PROBABILITY, checked, is_whole
from evoros.base.errors import InputError, require_extra
from evoros.optimizer import protocol
from evoros.optimizer.history import History, draw_seed

if TYPE_CHECKING:
    from pymoo.algorithms.moo.nsga2 import NSGA2

POPULATION = replace(
    COUNT, text="an even integer >= 4", holds=lambda v: is_whole(v) and v >= 4 and v % 2 == 0
)


@dataclass(frozen=True)
@checked
class Nsga2(protocol.BundledOptimizer):
    """NSGA-II, from the package ``pymoo``, which keeps nondominated designs.

    The operators are simulated binary crossover and polynomial mutation. A larger distribution
    index keeps children closer to their parents. All genes are treated as continuous. See K. Deb et
    al., "A Fast and Elitist Multiobjective Genetic Algorithm: NSGA-II", IEEE Transactions on
    Evolutionary Computation 6 (2), 2002.
    """

    population_size: Annotated[int, POPULATION] = 32
    crossover_probability: Annotated[float, PROBABILITY] = 0.9  # per pair of parents
    crossover_index: Annotated[float, POSITIVE] = 15.0
    mutation_index: Annotated[float, POSITIVE] = 20.0
    packages = ("pymoo",)

    def start(
        self, space: protocol.Space, goals: protocol.Goals, rng: Generator
    ) -> protocol.Search:
        protocol.require_genes(space)
        if len(goals.objectives) < 2:
            raise InputError(
                f"objectives: optimizer=nsga2 needs at least two measures, not "
                f"{list(goals.objectives)}; for example, add +measure@objectives.cost=cost, or "
                f"choose a single-objective optimizer such as ga"
            )
        with require_extra("search", "optimizer=nsga2"):
            from pymoo.algorithms.moo.nsga2 import NSGA2
            from pymoo.core.problem import Problem
            from pymoo.core.termination import NoTermination
            from pymoo.operators.crossover.sbx import SBX
            from pymoo.operators.mutation.pm import PM

        algorithm = NSGA2(
            pop_size=self.population_size,
            crossover=SBX(prob=self.crossover_probability, eta=self.crossover_index),
            mutation=PM(eta=self.mutation_index),
            eliminate_duplicates=False,
        )
        problem = Problem(n_var=space.size, n_obj=len(goals.objectives), xl=0.0, xu=1.0)
        algorithm.setup(problem, termination=NoTermination(), seed=draw_seed(rng), verbose=False)
        return _Nsga2Search(algorithm)


class _Nsga2Search:
    def __init__(self, algorithm: "NSGA2") -> None:
        self._algorithm, self._history = algorithm, History()
        self._ask("initial")

    def _ask(self, operator: str) -> None:
        self._offspring = self._algorithm.ask()
        self._history.ask(list(self._offspring.get("X")), operator)
        self._offspring.set("id", [individual.id for individual in self._history.asked])

    def ask(self) -> list[protocol.Individual]:
        return self._history.asked

    def tell(self, scores: Mapping[int, protocol.Score]) -> list[protocol.Candidate]:
        self._history.tell(scores)
        self._set_costs()
        self._algorithm.tell(infills=self._offspring)
        population = list(map(int, self._algorithm.pop.get("id")))
        table = self._history.tabulate([*scores, *population], population)
        self._ask("nsga2")
        return table

    def _set_costs(self) -> None:
        from pymoo.core.evaluator import Evaluator
        from pymoo.problems.static import StaticProblem

        for group in (self._offspring, self._algorithm.pop):
            if group is not None and len(group):
                scores = [self._history.scores[int(index)] for index in group.get("id")]
                costs = [-np.array(score.objectives) for score in scores]
                static = StaticProblem(self._algorithm.problem, F=np.array(costs))
                Evaluator(skip_already_evaluated=False).eval(static, group)

    def champions(self) -> list[protocol.Individual]:
        """Return the nondominated designs, fittest first."""
        population = self._algorithm.pop
        if population is None or not len(population):
            return []
        ranks = zip(population.get("id"), population.get("rank"), strict=True)
        return self._history.rank({int(index) for index, rank in ranks if rank == 0})
