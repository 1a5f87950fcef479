"""The number of clusters among points, with tests against random clouds and larger samples."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from scipy.cluster.hierarchy import linkage
from scipy.spatial.distance import pdist, squareform

from evoros.base.arrays import Array

from ..statistics.small_samples import LEVEL, SEED

MAX_CLUSTERS = 5
MIN_POINTS = 5
DRAWS = 499  # number of random point clouds or samples per test


@dataclass(frozen=True, eq=False)
class Clusters:
    """The best clustering of n points, and its significance."""

    cut: NDArray[np.int64]  # (n,) cluster of each point, counted from 1
    silhouette: float  # mean over the points: 1 if compact and separate, NaN for too few points
    expected: float  # 95 % quantile of the silhouettes of cluster-free point clouds
    p: float  # fraction of these with a silhouette at least as large; NaN for too few points

    @property
    def real(self) -> bool:
        """True if cluster-free point clouds rarely reach this silhouette."""
        return self.p < LEVEL

    @property
    def count(self) -> int:
        """The number of clusters; 1 without significant structure."""
        return len(set(self.cut.tolist())) if self.real else 1

    @property
    def labels(self) -> NDArray[np.int64]:
        """The cluster of each point (n,), from 1; all 1 without significant structure."""
        return self.cut if self.real else np.ones_like(self.cut)


def find_clusters(points: Array, draws: int = DRAWS) -> Clusters:
    """Cluster points (n, d) into 2 to ``MAX_CLUSTERS`` with the maximum mean silhouette.

    Clusters are found by Ward's method with Euclidean distances; silhouettes follow Rousseeuw
    (1987), J. Comput. Appl. Math. 20, 53-65. Cluster-free point clouds are uniform along the
    principal components, with equal covariance (Tibshirani et al. 2001, J. R. Stat. Soc. B 63,
    411-423).
    """
    n = len(points)
    if n < MIN_POINTS or not np.ptp(points, axis=0).any():
        return Clusters(np.ones(n, dtype=np.int64), np.nan, np.nan, np.nan)
    order = np.lexsort(points.round(9).T)
    centred = points[order] - points[order].mean(axis=0)
    silhouette, labels = cut_best(centred)
    cut = np.empty(n, dtype=np.int64)
    cut[order] = labels
    spread = np.linalg.svd(centred, compute_uv=False) / np.sqrt(n - 1)

    def cloud(rng: Generator) -> Array:
        return np.asarray(rng.uniform(-np.sqrt(3), np.sqrt(3), (n, len(spread))) * spread)

    drawn = _silhouettes(cloud, draws)
    return Clusters(cut, silhouette, float(np.quantile(drawn, 1 - LEVEL)), _p(silhouette, drawn))


def compare_with_samples(silhouette: float, n: int, pool: Array, draws: int = DRAWS) -> float:
    """Return a silhouette's p-value against samples of n from ``pool``, or NaN for under 2 n."""
    if np.isnan(silhouette) or len(pool) < 2 * n:
        return np.nan
    ordered = pool[np.lexsort(pool.T)]

    def sample(rng: Generator) -> Array:
        return ordered[rng.choice(len(ordered), n, replace=False)]

    return _p(silhouette, _silhouettes(sample, draws))


def cut_best(points: Array) -> tuple[float, NDArray[np.int64]]:
    """Return the maximum mean silhouette and the cluster (n,), counted from 1, of each point."""
    condensed = pdist(points)
    distances, cuts = squareform(condensed), _cuts(linkage(condensed, "ward"))
    scores = [_silhouette(distances, labels) for labels in cuts]
    best = int(np.argmax(scores))
    return scores[best], cuts[best]


def _cuts(tree: Array) -> list[NDArray[np.int64]]:
    """Cut a tree from ``linkage`` into 2 to ``MAX_CLUSTERS`` clusters; return labels from 1."""
    # SciPy's ``fcluster`` and ``cut_tree`` take ten times as long.
    n = len(tree) + 1
    members = {node: [node] for node in range(n)}  # points of each node, in ascending order
    cuts = []
    for step, (left, right) in enumerate(tree[:, :2].astype(int).tolist()):
        if n - step <= min(MAX_CLUSTERS, n - 1):
            labels = np.empty(n, dtype=np.int64)
            for number, points in enumerate(members.values(), 1):
                labels[points] = number
            cuts.append(labels)
        members[n + step] = members.pop(left) + members.pop(right)
    return cuts[::-1]


def _silhouette(distances: Array, labels: NDArray[np.int64]) -> float:
    """Return the mean silhouette of all points (not in SciPy); points alone in a cluster have 0."""
    row, column = np.arange(len(labels)), labels - 1
    size = np.bincount(column)
    sums = distances @ (labels[:, None] == np.arange(1, len(size) + 1))  # (n, clusters)
    members = size[column]
    inside = sums[row, column] / np.maximum(members - 1, 1)
    means = sums / size
    means[row, column] = np.inf
    nearest = means.min(axis=1)
    greater = np.maximum(inside, nearest)
    known = (members > 1) & (greater > 0)
    ratio = (nearest - inside) / np.where(greater > 0, greater, 1.0)
    return float(np.where(known, ratio, 0.0).mean())


def _silhouettes(draw: Callable[[Generator], Array], draws: int) -> Array:
    rng = np.random.default_rng(SEED)
    return np.array([cut_best(draw(rng))[0] for _ in range(draws)])


def _p(observed: float, drawn: Array) -> float:
    """Return a permutation p-value, which is never 0 (Davison and Hinkley 1997)."""
    return float((1 + np.count_nonzero(drawn >= observed - 1e-12)) / (1 + drawn.size))
