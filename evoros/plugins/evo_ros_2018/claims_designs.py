"""Tests the paper's claims on designs: configurations, redundancy, clusters, convergence."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.spatial.distance import pdist, squareform

from evoros.analysis.designs import features
from evoros.analysis.designs.clusters import MIN_POINTS, compare_with_samples
from evoros.analysis.statistics import finding, small_samples
from evoros.analysis.statistics.two_samples import a12_interval, brunner_munzel
from evoros.analysis.tables.designs import place_candidates, read_generations
from evoros.analysis.tables.records import Record
from evoros.base.arrays import Array

REDUNDANT = 0.6  # fraction of champions with a redundant pair in the paper, six of ten
MEDIUM = 0.64  # A12 of a medium effect (Vargha and Delaney, 2000)
NONE, RANDOM, SPATIAL = "none", "random", "spatial"  # options of the group ``failure``

CONFIGURATIONS = finding.Claim(
    "Two main configurations emerge: sensors across the front, and at the sides",
    "silhouette of the best clustering by viewing directions",
    finding.NUMBER,
)
REDUNDANCY = finding.Claim(
    "Random failure: in six of ten champions, two sensors have nearly the same position and "
    "direction",
    "champions with a redundant pair",
)
DAMAGE = "Spatial failure: there are clusters of sensors within the radius of damage"
BETWEEN = finding.Claim(
    "Placed freely, without symmetry, designs converge little",
    "spread of champions relative to random designs, free minus mirrored",
    finding.NUMBER,
)
WITHIN = finding.Claim(
    "Placed freely, without symmetry, designs converge little",
    "median ratio of the last population's diversity to the first's, free placement",
    finding.NUMBER,
)


def judge_configurations(table: pd.DataFrame) -> finding.Finding:
    """Test whether mirrored champions form two clusters, one of which looks ahead."""
    champions = table[~table.random]
    if len(champions) < MIN_POINTS:
        known = len(champions)
        return CONFIGURATIONS.lack(f"{MIN_POINTS} champions with mirrored designs, not {known}")
    clustering = features.cluster_designs(champions)
    names = (features.FRONT, features.SIDE)
    front, side = (int((champions.strategy == name).sum()) for name in names)
    strategies = champions.groupby(clustering.labels).strategy.first()
    if clustering.real:
        two = clustering.count == 2 and strategies.nunique() == 2
        verdict = finding.SUPPORTED if two else finding.NOT_SUPPORTED
    else:
        verdict = finding.NOT_SUPPORTED if clustering.p >= 0.5 else finding.UNKNOWN
    clusters = "1 cluster" if clustering.count == 1 else f"{clustering.count} clusters"
    why = f"{clusters}; {front} front arrays and {side} side mounts"
    pool = features.compute_directions(table[table.random][features.HEADINGS_DEG].drop_duplicates())
    rarity = compare_with_samples(clustering.silhouette, len(champions), pool)
    if not np.isnan(rarity):
        why += f"; p {rarity:.2g} among samples of random designs"
    verdict, why = finding.require_beyond_random(verdict, why, not rarity >= small_samples.LEVEL)
    silhouette = small_samples.Interval(clustering.silhouette)
    against = finding.Against(clustering.expected, p=clustering.p)
    return CONFIGURATIONS.conclude(silhouette, len(champions), (verdict, why), against)


def judge_redundancy(table: pd.DataFrame) -> finding.Finding:
    """Test the fraction of champions under random failure that have a redundant pair."""
    shares = _compare_shares(table, RANDOM, table.redundant)
    if shares is None:
        return REDUNDANCY.lack("mirrored runs with failure=random")
    reached = finding.NOT_SUPPORTED if shares.champions.high < REDUNDANT else finding.SUPPORTED
    return shares.conclude(REDUNDANCY, reached, REDUNDANT)


def judge_damage_clusters(table: pd.DataFrame, radius_m: float) -> finding.Finding:
    """Test how often champions under spatial failure have two sensors within a radius."""
    radius = f"{1000 * radius_m:.0f} mm"
    claim = finding.Claim(DAMAGE, f"champions with two sensors within {radius} of each other")
    shares = _compare_shares(table, SPATIAL, table.closest_m <= radius_m)
    if shares is None:
        return claim.lack("mirrored runs with failure=spatial")
    return shares.conclude(claim, finding.judge_above(shares.champions, 0.5), 0.5)


@dataclass(frozen=True)
class Shares:
    """The fractions of champions and of random designs that have a feature."""

    champions: small_samples.Interval
    n: int  # number of champions
    random: float  # fraction of the random designs; NaN if there are none
    difference: small_samples.Interval
    p: float  # p-value of Fisher's exact test
    why: str

    def conclude(self, claim: finding.Claim, verdict: str, bound: float) -> finding.Finding:
        """Return the finding on a claim, supported only if champions differ from random designs."""
        if self.p < small_samples.LEVEL and self.difference.value < 0:
            verdict = finding.NOT_SUPPORTED
        rare = self.p < small_samples.LEVEL
        judged = finding.require_beyond_random(verdict, self.why, rare, self.difference)
        against = finding.Against(bound, self.random, self.p)
        return claim.conclude(self.champions, self.n, judged, against)


def _compare_shares(table: pd.DataFrame, kind: str, having: "pd.Series[bool]") -> Shares | None:
    champions = having[(table.kind == kind) & ~table.random]
    drawn = having[(table.kind == kind) & table.random]
    if champions.empty:
        return None
    counts = int(champions.sum()), len(champions), int(drawn.sum()), len(drawn)
    rate = counts[2] / counts[3] if len(drawn) else np.nan
    difference = small_samples.share_difference(*counts)
    without = having[(table.kind == NONE) & ~table.random]
    also = f"; {int(without.sum())} of {len(without)} without failure" if len(without) else ""
    compared = f"{rate:.0%} of random designs, difference {difference.write()}"
    why = f"{counts[0]} of {counts[1]}, {compared if len(drawn) else 'no random designs'}{also}"
    interval, p = small_samples.share_interval(*counts[:2]), small_samples.fisher(*counts)
    return Shares(interval, len(champions), rate, difference, p, why)


def judge_spread_between(mirrored: pd.DataFrame, free: pd.DataFrame) -> finding.Finding:
    """Test whether, relative to random designs, free champions differ more than mirrored ones."""
    ratios = []
    for table in (free, mirrored):
        champions, drawn = (
            pairwise_distances(table.loc[table.random == flag, features.HEADINGS_DEG])
            for flag in (0, 1)
        )
        if len(champions) < 2 or not mean_distance(drawn) > 0:
            return BETWEEN.lack(_missing_runs(mirrored, free))
        ratios.append((champions, mean_distance(drawn)))
    difference = relative_difference(*ratios[0], *ratios[1])
    relative = [mean_distance(champions) / drawn for champions, drawn in ratios]
    why = f"free {relative[0]:.2f}, mirrored {relative[1]:.2f} (1: as far apart as random designs)"
    counts = [len(champions) for champions, _ in ratios]
    verdict = finding.require_replicates(finding.judge_more(difference), *counts)
    return BETWEEN.conclude(difference, counts[0], (verdict, why), finding.Against(0.0))


def judge_spread_within(mirrored: pd.DataFrame, free: pd.DataFrame) -> finding.Finding:
    """Test whether free populations stay more diverse than mirrored ones (``read_diversity``)."""
    ratios = [(table["last"] / table["first"]).to_numpy(float) for table in (free, mirrored)]
    if min(map(len, ratios)) < 2:
        return WITHIN.lack(_missing_runs(mirrored, free))
    interval, other = small_samples.median_interval(ratios[0]), float(np.median(ratios[1]))
    p, effect = brunner_munzel(*ratios), a12_interval(*ratios)
    more = p < small_samples.LEVEL and effect.value > 0.5
    verdict = finding.SUPPORTED if more else finding.judge_above(effect, MEDIUM)
    why = f"mirrored {other:.2f}; A12 {effect.write()}"
    return WITHIN.conclude(interval, len(ratios[0]), (verdict, why), finding.Against(other, p=p))


def _missing_runs(mirrored: pd.DataFrame, free: pd.DataFrame) -> str:
    if free.empty:
        return "runs with experiment=free_placement"
    if mirrored.empty:
        return "mirrored runs with the same failure"
    return "two runs of each"


def pairwise_distances(profiles: pd.DataFrame) -> Array:
    """Return total variation distances (n, n), 0 to 1, between the sensor directions of designs."""
    return np.asarray(squareform(pdist(features.normalize_profiles(profiles), "cityblock")) / 2)


def mean_distance(distances: Array) -> float:
    """Return the mean distance between two different designs; NaN for fewer than two."""
    n = len(distances)
    return float(distances.sum() / (n * (n - 1))) if n > 1 else np.nan


def resample_mean_distance(distances: Array, stream: int = 0) -> Array:
    """Return ``mean_distance`` of ``RESAMPLES`` bootstrap samples of the designs."""
    # Unlike in SciPy's bootstrap, a design forms no pair with itself, which would cause a bias.
    n, rng = len(distances), np.random.default_rng([small_samples.SEED, stream])
    counts = rng.multinomial(n, np.full(n, 1 / n), size=small_samples.RESAMPLES)
    pairs = n * n - (counts * counts).sum(axis=1)
    sums = ((counts @ distances) * counts).sum(axis=1)
    return np.asarray(sums / np.where(pairs == 0, np.nan, pairs))


def relative_difference(
    one: Array, one_random: float, other: Array, other_random: float
) -> small_samples.Interval:
    """Return the difference of two mean distances, each divided by one for random designs."""
    value = mean_distance(one) / one_random - mean_distance(other) / other_random
    if min(len(one), len(other)) < 2:
        return small_samples.NOTHING
    first, second = resample_mean_distance(one), resample_mean_distance(other, 1)
    tail = small_samples.expand_tail(min(len(one), len(other)))
    low, high = np.nanquantile(first / one_random - second / other_random, [tail, 1 - tail])
    return small_samples.Interval(float(value), float(low), float(high))


def read_diversity(record: Record) -> pd.DataFrame:
    """Return the mean distances between designs, with copies, in the first and last population."""
    table = read_generations(record)
    first = table[table.generation == 0].drop_duplicates("id")
    pool = table[table.generation == table.generation.max()]
    survived = pool.groupby("id").survived.sum()  # an individual may occupy several rows
    last = pool.drop_duplicates("id").assign(survived=lambda rows: rows.id.map(survived))
    copies = {"first": first.assign(survived=1), "last": last}
    return pd.DataFrame({name: [_diversity(rows, record)] for name, rows in copies.items()})


def _diversity(candidates: pd.DataFrame, record: Record) -> float:
    placed = place_candidates(candidates, record)
    named = placed.assign(run=record.name, treatment="", seed=record.seed)
    profiles = features.compute_profiles(named)
    profiles.index = profiles.index.get_level_values("design")
    complete = profiles.reindex(candidates.id, fill_value=0.0)  # adds designs without sensors
    ids = np.repeat(candidates.id.to_numpy(), candidates.survived.to_numpy(int))
    return mean_distance(pairwise_distances(complete.loc[ids]))
