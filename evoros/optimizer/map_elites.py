"""MAP-Elites: the best design in each cell of a grid over the descriptors."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import COUNT, NOT_NEGATIVE, PROBABILITY, WHOLE, checked
from evoros.optimizer.archive_search import CELLS, Elites, create_archive
from evoros.optimizer.library import draw_seed, list_categories, require_library
from evoros.optimizer.protocol import (
    Candidate,
    Goals,
    Individual,
    Score,
    Search,
    Space,
    require_genes,
)

if TYPE_CHECKING:
    from ribs.emitters import IsoLineEmitter


@dataclass(frozen=True)
@checked
class MapElites:
    """MAP-Elites of the package ``ribs``, with the iso+line operator.

    The first generation is random. Later ones are elites that move by normal noise, and along the
    line to another elite; each region and type of a sensor is drawn anew with a probability.

    J.-B. Mouret and J. Clune, "Illuminating Search Spaces by Mapping Elites", arXiv:1504.04909;
    V. Vassiliades and J.-B. Mouret, "Discovering the Elite Hypervolume by Leveraging Interspecies
    Correlation", GECCO 2018, arXiv:1804.03906.
    """

    population_size: Annotated[int, COUNT] = 32
    generations: Annotated[int, COUNT] = 25
    validation_trials: Annotated[int, WHOLE] = 5  # of each generation's best, on fresh draws
    cells: Annotated[int, CELLS] = 10  # along each descriptor
    noise: Annotated[float, NOT_NEGATIVE] = 0.05  # standard deviation, as a share of the ranges
    line_noise: Annotated[float, NOT_NEGATIVE] = 0.2  # standard deviation, of the way to another
    redraw_probability: Annotated[float, PROBABILITY] = 0.05  # of each category
    packages = ("ribs",)

    def start(self, space: Space, goals: Goals, rng: Generator) -> Search:
        """Start a search by fitness and descriptors, whose generators are seeded by ``rng``.

        Raises:
            InputError: there are no genes or no descriptors, or the package is not installed.
        """
        require_genes(space)
        with require_library("map_elites"):
            from ribs.emitters import IsoLineEmitter

        archive = create_archive(space, goals, self.cells, rng)
        emitter = IsoLineEmitter(
            archive,
            iso_sigma=self.noise,
            line_sigma=self.line_noise,
            initial_solutions=rng.random((self.population_size, space.size)),
            lower_bounds=[0.0] * space.size,
            upper_bounds=[1.0] * space.size,
            batch_size=self.population_size,
            seed=draw_seed(rng),
        )
        categories = list_categories(space)
        return _MapElitesSearch(Elites(archive), emitter, categories, self.redraw_probability, rng)


class _MapElitesSearch:
    def __init__(
        self,
        elites: Elites,
        emitter: "IsoLineEmitter",
        categories: list[int],
        redraw_probability: float,
        rng: Generator,
    ) -> None:
        self._elites, self._emitter, self._rng = elites, emitter, rng
        self._categories, self._probability = categories, redraw_probability
        self._elites.history.ask(list(emitter.ask()), "initial")

    def ask(self) -> list[Individual]:
        return self._elites.history.asked

    def tell(self, scores: Mapping[int, Score]) -> list[Candidate]:
        self._elites.tell(scores)
        table = self._elites.tabulate(scores)
        genomes = [self._redraw(genome) for genome in self._emitter.ask()]
        self._elites.history.ask(genomes, "iso_line")
        return table

    def champions(self) -> list[Individual]:
        return self._elites.champions()

    def _redraw(self, genome: Array) -> Array:
        """Draw some of the categories anew."""
        values = np.array(genome)
        for gene in self._categories:
            if self._rng.random() < self._probability:
                values[gene] = self._rng.random()
        return values
