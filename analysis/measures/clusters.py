"""Do some points fall into clusters, and into how many? Ward's clustering, silhouettes, two tests.

Clusters are found in any cloud. So the best silhouette is compared with that of the same clustering
of clouds without clusters, and, by whoever has a larger pool, with that of samples from it.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from scipy.cluster.hierarchy import linkage
from scipy.spatial.distance import pdist, squareform

from evoros.base.arrays import Array

from .statistics import LEVEL, SEED

MOST = 5  # clusters that are tried
LEAST = 5  # points that can show any
DRAWS = 499  # clouds, or samples, to compare with


@dataclass(frozen=True, eq=False)
class Clusters:
    """The best clustering of n points, and whether it says anything."""

    found: NDArray[np.int64]  # (n,) cluster of each point by the best clustering, from 1
    silhouette: float  # mean over the points: 1 tight and apart, 0 no structure; NaN: too few
    expected: float  # below which 95 % of the clouds without clusters stay
    p: float  # share of such clouds that have a silhouette as great; NaN: too few points

    @property
    def real(self) -> bool:
        """Whether there are clusters at all: clouds without any seldom look like this."""
        return self.p < LEVEL

    @property
    def count(self) -> int:
        """The number of clusters; 1 where there is no structure."""
        return len(set(self.found.tolist())) if self.real else 1

    @property
    def labels(self) -> NDArray[np.int64]:
        """(n,) cluster of each point, from 1; all 1 where there is no structure."""
        return self.found if self.real else np.ones_like(self.found)


def clusters(points: Array, draws: int = DRAWS) -> Clusters:
    """The clustering (n, d) with the greatest mean silhouette, of those into 2 to ``MOST``.

    Ward's method on Euclidean distances; silhouettes as Rousseeuw (1987), J. Comput. Appl. Math.
    20, 53-65. The clouds fill a box along the principal components of the points, evenly, with
    their covariance (as the gap statistic's: Tibshirani et al. 2001, J. R. Stat. Soc. B 63,
    411-423), and choose their number of clusters in the same way. Even, not normal: of all without
    clusters these split best. What bends, though one thing alone varies, looks clustered to this
    test: the coordinates must be such that it follows a line. The order of the points makes no
    difference.
    """
    n = len(points)
    if n < LEAST or not np.ptp(points, axis=0).any():
        return Clusters(np.ones(n, dtype=np.int64), np.nan, np.nan, np.nan)
    order = np.lexsort(points.round(9).T)
    centred = points[order] - points[order].mean(axis=0)
    silhouette, labels = best_silhouette(centred)
    found = np.empty(n, dtype=np.int64)
    found[order] = labels
    spread = np.linalg.svd(centred, compute_uv=False) / np.sqrt(n - 1)

    def cloud(rng: Generator) -> Array:
        return np.asarray(rng.uniform(-np.sqrt(3), np.sqrt(3), (n, len(spread))) * spread)

    drawn = _silhouettes(cloud, draws)
    return Clusters(found, silhouette, float(np.quantile(drawn, 1 - LEVEL)), _p(silhouette, drawn))


def p_of_samples(silhouette: float, n: int, pool: Array, draws: int = DRAWS) -> float:
    """How often n points of ``pool`` (m, d) have a silhouette as great; NaN: the pool is small."""
    if np.isnan(silhouette) or len(pool) < 2 * n:
        return np.nan
    ordered = pool[np.lexsort(pool.T)]

    def sample(rng: Generator) -> Array:
        return ordered[rng.choice(len(ordered), n, replace=False)]

    return _p(silhouette, _silhouettes(sample, draws))


def best_silhouette(points: Array) -> tuple[float, NDArray[np.int64]]:
    """The greatest mean silhouette, and the cluster of each point (n,), from 1."""
    condensed = pdist(points)
    distances, tried = squareform(condensed), _cuts(linkage(condensed, "ward"))
    scores = [_silhouette(distances, labels) for labels in tried]
    best = int(np.argmax(scores))
    return scores[best], tried[best]


def _cuts(tree: Array) -> list[NDArray[np.int64]]:
    """The clusters of each point in 2 to ``MOST`` clusters, of a tree as scipy's ``linkage`` gives.

    The last merges undone one by one. As ``fcluster``, which checks the whole tree for each cut:
    with many small clouds that is what takes the time.
    """
    n = len(tree) + 1
    children = tree[:, :2].astype(int)
    members = [[i] for i in range(n)]
    for left, right in children:
        members.append(members[left] + members[right])
    found, nodes = [], [2 * n - 2]
    for _ in range(2, min(MOST, n - 1) + 1):
        last = max(nodes)
        nodes = [node for node in nodes if node != last] + list(children[last - n])
        labels = np.empty(n, dtype=np.int64)
        for label, node in enumerate(nodes, 1):
            labels[members[node]] = label
        found.append(labels)
    return found


def _silhouette(distances: Array, labels: NDArray[np.int64]) -> float:
    """The mean over all points; of a point alone in its cluster, 0."""
    member = labels[:, None] == np.arange(1, labels.max() + 1)
    size = member.sum(axis=0)
    to = distances @ member  # (n, clusters) sum of the distances to each cluster's points
    own = np.where(member, to, 0.0).sum(axis=1) / np.maximum((member * size).sum(axis=1) - 1, 1)
    other = np.where(member, np.inf, to / size).min(axis=1)
    greater = np.maximum(own, other)
    alone = (member * size).sum(axis=1) == 1
    known = ~alone & (greater > 0)
    return float(np.where(known, (other - own) / np.where(greater > 0, greater, 1.0), 0.0).mean())


def _silhouettes(draw: Callable[[Generator], Array], draws: int) -> Array:
    rng = np.random.default_rng(SEED)
    return np.array([best_silhouette(draw(rng))[0] for _ in range(draws)])


def _p(observed: float, drawn: Array) -> float:
    """A share that is never 0 (Davison and Hinkley 1997)."""
    return float((1 + np.count_nonzero(drawn >= observed - 1e-12)) / (1 + drawn.size))
