"""MAP-Elites, which finds the best design in each cell of a grid over descriptors."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import COUNT, NOT_NEGATIVE, PROBABILITY, checked
from evoros.base.errors import require_extra
from evoros.optimizer import history
from evoros.optimizer.protocol import BundledOptimizer, Goals, Search, Space, require_genes


@dataclass(frozen=True)
@checked
class MapElites(BundledOptimizer):
    """MAP-Elites with the iso+line operator, from the package ``ribs``.

    The first generation is random. Later generations perturb elites with normal noise and along the
    line to another elite, and redraw each sensor's region and type with ``redraw_probability``. See
    J.-B. Mouret and J. Clune, "Illuminating Search Spaces by Mapping Elites", arXiv:1504.04909; V.
    Vassiliades and J.-B. Mouret, "Discovering the Elite Hypervolume by Leveraging Interspecies
    Correlation", GECCO 2018, arXiv:1804.03906.
    """

    population_size: Annotated[int, COUNT] = 32
    cells: Annotated[int, history.CELLS] = 10  # number of cells along each descriptor
    noise: Annotated[float, NOT_NEGATIVE] = 0.05  # standard deviation as a fraction of the ranges
    line_noise: Annotated[float, NOT_NEGATIVE] = 0.2  # relative to the distance between two elites
    redraw_probability: Annotated[float, PROBABILITY] = 0.05  # per categorical gene
    packages = ("ribs",)

    def start(self, space: Space, goals: Goals, rng: Generator) -> Search:
        require_genes(space)
        with require_extra("search", "optimizer=map_elites"):
            from ribs.emitters import IsoLineEmitter

        archive = history.create_archive(space, goals, self.cells, rng)
        emitter = IsoLineEmitter(
            archive,
            iso_sigma=self.noise,
            line_sigma=self.line_noise,
            initial_solutions=rng.random((self.population_size, space.size)),
            lower_bounds=[0.0] * space.size,
            upper_bounds=[1.0] * space.size,
            batch_size=self.population_size,
            seed=history.draw_seed(rng),
        )
        categories = history.list_categories(space)

        def redraw(genome: Array) -> Array:
            values = np.array(genome)
            for gene in categories:
                if rng.random() < self.redraw_probability:
                    values[gene] = rng.random()
            return values

        def propose() -> list[Array]:  # learns nothing, because the emitter reads the archive
            genomes = list(emitter.ask())
            return genomes if archive.empty else list(map(redraw, genomes))

        return history.ArchiveSearch(archive, history.FixedSampler("iso_line", propose))
