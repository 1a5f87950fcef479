"""A started search with checked return values, because users may write searches."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from evoros.base.checks import Rule, ask
from evoros.optimizer.protocol import Candidate, Individual, Score, Search

KEY = "optimizer"


@dataclass(frozen=True)
class AskedSearch:
    """Forwards calls to a search, and raises an InputError for an invalid return value."""

    search: Search
    size: int  # number of genes
    known: set[int] = field(default_factory=set)  # all ids so far

    def ask(self) -> Sequence[Individual]:
        """Return the individuals of the next generation."""
        text = f"a list of individuals with distinct ids and {self.size} genes from 0 to 1"
        asked: Sequence[Individual] = ask(KEY, self.search.ask, Rule(text, self._are_points))
        self.known.update(one.id for one in asked)
        return asked

    def tell(self, scores: Mapping[int, Score]) -> Sequence[Candidate]:
        """Return the table of the generation."""
        rule = Rule("a non-empty list of candidates from ask()", self._are_candidates)
        table: Sequence[Candidate] = ask(KEY, self.search.tell, rule, scores)
        return table

    def champions(self) -> Sequence[Individual]:
        """Return the champions, best first."""
        rule = Rule("a non-empty list of individuals from ask()", self._are_known)
        best: Sequence[Individual] = ask(KEY, self.search.champions, rule)
        return best

    def _are_points(self, value: object) -> bool:
        if not isinstance(value, list | tuple):
            return False
        ids = {one.id for one in value if isinstance(one, Individual)}
        return len(ids) == len(value) and all(self._is_point(one.genome) for one in value)

    def _is_point(self, genome: object) -> bool:
        if not isinstance(genome, np.ndarray) or genome.dtype.kind not in "fiu":
            return False
        return genome.shape == (self.size,) and bool(np.all((genome >= 0.0) & (genome <= 1.0)))

    def _are_candidates(self, value: object) -> bool:
        rows = value if isinstance(value, list | tuple) else ()
        candidates = [row.individual for row in rows if isinstance(row, Candidate)]
        return len(candidates) == len(rows) and self._are_known(candidates)

    def _are_known(self, value: object) -> bool:
        some = value if isinstance(value, list | tuple) else ()
        return bool(some) and all(isinstance(x, Individual) and x.id in self.known for x in some)
