"""Coverage, clusters, redundancy and damage, against hand-made designs and known clouds."""

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.spatial.distance import cdist

from evoros.analysis.designs.clusters import compare_with_samples, cut_best, find_clusters
from evoros.analysis.designs.features import (
    ALL,
    FRONT,
    HEADINGS_DEG,
    SIDE,
    compare_with_random,
    compute_directions,
    compute_profiles,
    describe_designs,
    measure_nearness,
    normalize_profiles,
    paper_rings,
    share_ahead,
)
from evoros.analysis.drawing.finish import letter
from evoros.analysis.drawing.style import PAGE_IN
from evoros.analysis.figures.strategies import draw_strategies, report_designs
from evoros.analysis.tables.designs import select_random
from evoros.failure.spatial import SpatialFailure
from evoros.filter.protocol import Channels
from evoros.storage.figure_context import Ring

Mount = tuple[float, float, float]  # x [m], y [m], yaw [deg]


def design(
    name: str, mounts: Sequence[Mount], treatment: str = "none", mirrored: bool = False
) -> pd.DataFrame:
    """The table of a design; with ``mirrored`` each mount has a twin on the other side."""
    mounted = [(*m, i) for i, m in enumerate(mounts)]
    if mirrored:
        mounted = [one for x, y, yaw, i in mounted for one in ((x, y, yaw, i), (x, -y, -yaw, i))]
    frame = pd.DataFrame(mounted, columns=["x_m", "y_m", "yaw_deg", "pair"])
    frame = frame.assign(run=name, treatment=treatment, seed=0, design=0, sensor=range(len(frame)))
    return frame.assign(z_m=0.1, pitch_deg=12.5, fov_deg=30.0)


def designs(mounted: Iterable[Sequence[Mount]], treatment: str = "none") -> pd.DataFrame:
    return pd.concat(
        [design(f"{treatment}{i:03}", m, treatment, True) for i, m in enumerate(mounted)],
        ignore_index=True,
    )


ANGLES = st.integers(-35, 35).map(lambda k: 5.0 * k)
PLACES = st.integers(-25, 25).map(lambda k: k / 100)
MOUNTS = st.lists(st.tuples(PLACES, PLACES, ANGLES), min_size=1, max_size=5)


# Coverage ------------------------------------------------------------------------------------


def seen(table: pd.DataFrame) -> dict[float, float]:
    (row,) = compute_profiles(table).to_numpy()
    return {float(h): float(n) for h, n in zip(HEADINGS_DEG, row, strict=True) if n}


def test_a_single_ray_counts_for_one_degree() -> None:
    """So it covers the heading in which it looks, and designs of single rays have a strategy."""
    ahead = design("ahead", [(0.2, 0.0, 0.0), (0.2, 0.1, 20.0)]).assign(fov_deg=0.0)
    aside = design("aside", [(0.0, 0.1, 90.0), (0.0, -0.1, -91.0)]).assign(fov_deg=0.0)
    assert seen(ahead) == {0.0: pytest.approx(1 / 5), 20.0: pytest.approx(1 / 5)}
    both = pd.concat([ahead, aside], ignore_index=True)
    assert share_ahead(both).tolist() == [1.0, 0.0]
    described: Any = describe_designs(both, both).set_index("run")
    assert described.loc["ahead", "strategy"].unique().tolist() == [FRONT]
    assert described.loc["aside", "strategy"].unique().tolist() == [SIDE]
    mixed = ahead.assign(fov_deg=[0.0, 30.0])
    assert share_ahead(mixed).tolist() == [pytest.approx((1.0 + 25.0) / 31.0)]


INNER = [-10.0, -5.0, 0.0, 5.0, 10.0]


def test_a_sensor_that_looks_ahead_covers_half_its_opening_to_each_side() -> None:
    assert seen(design("a", [(0, 0, 0)])) == {**dict.fromkeys(INNER, 1.0), -15: 0.5, 15: 0.5}


def test_a_sensor_that_looks_back_covers_both_ends() -> None:
    ends = {-180.0: 1, -175: 1, 175: 1, -170: 1, 170: 1, -165: 0.5, 165: 0.5}
    assert seen(design("a", [(0, 0, 180)])) == seen(design("a", [(0, 0, -180)])) == ends


def test_a_small_turn_is_a_small_difference() -> None:
    """By 1 deg to the left, a fifth of a step."""
    turned = {**dict.fromkeys(INNER, 1.0), -15: 0.3, 15: 0.7}
    assert seen(design("a", [(0, 0, 1)])) == pytest.approx(turned)


def test_sensors_add_up_to_their_openings() -> None:
    both = seen(design("a", [(0, 0, 0), (0, 0, 20)]))
    assert (both[0], both[5], both[10], both[35]) == (1, 1.5, 2, 0.5)
    assert sum(both.values()) * 5 == pytest.approx(60)


@settings(max_examples=25, deadline=None)
@given(MOUNTS)
def test_the_mirror_image_of_a_design_has_the_mirrored_profile(mounts: list[Mount]) -> None:
    image = [(x, -y, -yaw) for x, y, yaw in mounts]
    one, other = design("a", mounts), design("a", image)
    mirrored = {-h if h > -180 else h: n for h, n in seen(one).items()}
    assert mirrored == pytest.approx(seen(other))
    np.testing.assert_allclose(
        compute_directions(compute_profiles(one)),
        compute_directions(compute_profiles(other)),
        atol=1e-9,
    )
    assert share_ahead(one).iloc[0] == pytest.approx(share_ahead(other).iloc[0])


@pytest.mark.parametrize("turn", [5.0, 10, 60])
def test_designs_are_as_far_apart_as_their_cones_are_turned(turn: float) -> None:
    one, other = ([(0, 0, 30.0), (0, 0, -70.0)], [(0, 0, 30 + turn), (0, 0, -70.0 - turn)])
    mounted = [
        compute_directions(compute_profiles(design("a", mounts)))[0] for mounts in (one, other)
    ]
    np.testing.assert_allclose(mounted[1] - mounted[0], turn)


def test_the_directions_of_one_cone_are_those_of_its_opening() -> None:
    """Sectors of 5 deg limit the accuracy: half a sector at the end is half covered."""
    (clusters,) = compute_directions(compute_profiles(design("a", [(0, 0, 40)])))
    np.testing.assert_allclose(clusters, 25 + 30 * (np.arange(36) + 0.5) / 36, atol=2.5)
    (ahead_,) = compute_directions(compute_profiles(design("a", [(0, 0, 0)])))
    np.testing.assert_allclose(ahead_, 15 * (np.arange(36) + 0.5) / 36, atol=2.5)
    np.testing.assert_allclose(ahead_[:29], 15 * (np.arange(29) + 0.5) / 36)  # exact up to 12.5
    (back,) = compute_directions(compute_profiles(design("a", [(0, 0, 180)])))
    np.testing.assert_allclose(back, 180 - ahead_[::-1], atol=1e-9)
    blind = design("a", [(math.nan, math.nan, math.nan)])
    assert (compute_directions(compute_profiles(blind)) == 180).all()


@pytest.mark.parametrize(
    ("yaws", "share"),
    [([0], 1), ([15], 1), ([30], 0.5), ([45], 0), ([-35], 1 / 3), ([0, 90], 0.5), ([180], 0)],
)
def test_the_share_ahead_by_hand(yaws: list[float], share: float) -> None:
    assert share_ahead(design("a", [(0, 0, yaw) for yaw in yaws])).iloc[0] == pytest.approx(share)


def test_a_design_without_sensors_covers_nothing_and_is_far_from_all_others() -> None:
    blind = design("b", [(math.nan, math.nan, math.nan)])
    table = compute_profiles(
        pd.concat([design("a", [(0, 0, 0)]), blind, design("c", [(0, 0, 90)])])
    )
    assert table.sum(axis=1).tolist() == [6, 0, 6]
    distance = (
        np.abs(normalize_profiles(table)[:, None] - normalize_profiles(table)[None]).sum(axis=2) / 2
    )
    np.testing.assert_allclose(distance, 1 - np.eye(3), atol=1e-12)
    assert math.isnan(share_ahead(blind).iloc[0])
    assert measure_nearness(blind).iloc[0].tolist() == [0, False, math.inf, 0.0]


# Clusters ------------------------------------------------------------------------------------


def two_groups(n: int, rng: np.random.Generator) -> np.ndarray:
    return np.vstack([rng.normal(0, 0.3, (n, 6)), rng.normal(2, 0.3, (n, 6))])


def test_two_groups_apart_are_two_clusters() -> None:
    clusters = find_clusters(two_groups(8, np.random.default_rng(1)))
    assert clusters.count == 2
    assert clusters.p < 0.01
    assert sorted(np.bincount(clusters.labels)[1:]) == [8, 8]
    assert len(set(clusters.labels[:8])) == len(set(clusters.labels[8:])) == 1


@pytest.mark.slow
def test_a_cloud_without_structure_seldom_has_clusters() -> None:
    """The test keeps its level: about one in twenty clouds, round or long, looks clustered."""
    rng = np.random.default_rng(3)
    shape = np.diag([3.0, 1, 1, 0.5, 0.1])
    clusters = [
        find_clusters(rng.standard_normal((20, 5)) @ shape, draws=99).real for _ in range(25)
    ]
    assert sum(clusters) <= stats.binom.ppf(0.999, 25, 0.05)


@pytest.mark.parametrize("spread_deg", [0.5, 3.0, 15.0])
def test_designs_around_one_are_one_cluster_however_near(spread_deg: float) -> None:
    rng = np.random.default_rng(4)
    base = np.array([35.0, 45, 55])
    yaws = base + rng.normal(0, spread_deg, (30, 3))
    table = designs([[(0.1, 0.1, yaw) for yaw in mounted] for mounted in yaws])
    assert find_clusters(compute_directions(compute_profiles(table)), 99).count == 1


def test_equal_points_and_few_points_have_no_clusters() -> None:
    for points in (np.ones((9, 3)), np.eye(4), np.empty((0, 3))):
        clusters = find_clusters(points)
        assert (clusters.count, clusters.labels.tolist()) == (1, [1] * len(points))


def test_the_silhouette_by_hand() -> None:
    """0, 1 and 10, 11: 0 has (10.5 - 1) / 10.5, 1 has (9.5 - 1) / 9.5; the others mirror them."""
    points = np.array([[0.0], [1], [10], [11], [10]])
    by_hand = np.mean(
        [
            1 - 1 / np.mean([10, 11, 10]),
            1 - 1 / np.mean([9, 10, 9]),
            *[1 - 0.5 / 9.5] * 2,
            1 - 1 / 10.5,
        ]
    )
    assert find_clusters(points, 9).silhouette == pytest.approx(by_hand)


@settings(max_examples=25, deadline=None)
@given(st.integers(5, 12), st.integers(0, 1000))
def test_clusters_are_those_of_scipy(n: int, seed: int) -> None:
    """The tried number of clusters with the greatest mean silhouette."""
    points = np.random.default_rng(seed).standard_normal((n, 3))
    tree, distance = linkage(points, "ward"), cdist(points, points)
    cuts = [fcluster(tree, k, "maxclust") for k in range(2, min(5, n - 1) + 1)]
    scores = [silhouette(distance, labels) for labels in cuts]
    score, labels = cut_best(points)
    assert score == pytest.approx(max(scores))
    expected = cuts[int(np.argmax(scores))]
    np.testing.assert_array_equal(labels[:, None] == labels, expected[:, None] == expected)


def silhouette(distance: np.ndarray, labels: np.ndarray) -> float:
    """The definition of Rousseeuw, a point after the other."""
    mounted = []
    for i, label in enumerate(labels):
        part = [distance[i, j] for j in np.flatnonzero(labels == label) if j != i]
        if not part:
            mounted.append(0.0)
            continue
        a = float(np.mean(part))
        b = min(distance[i, labels == other].mean() for other in set(labels) - {label})
        mounted.append((b - a) / max(a, b))
    return float(np.mean(mounted))


def test_the_order_of_points_changes_nothing() -> None:
    points = two_groups(6, np.random.default_rng(2))
    order = np.random.default_rng(0).permutation(len(points))
    one, other = find_clusters(points, 99), find_clusters(points[order], 99)
    assert (one.silhouette, one.p, one.expected) == (other.silhouette, other.p, other.expected)
    assert (one.labels[order][0] == one.labels[order]).tolist() == (
        other.labels[0] == other.labels
    ).tolist()


def test_samples_of_the_pool_look_like_the_pool() -> None:
    rng = np.random.default_rng(5)
    cloud, apart = rng.standard_normal((200, 3)), two_groups(100, rng)
    clustered = find_clusters(apart[::10], 9).silhouette
    assert compare_with_samples(clustered, 20, cloud, 99) == 0.01  # none of the 99
    assert compare_with_samples(clustered, 20, apart, 99) > 0.05
    assert math.isnan(compare_with_samples(clustered, 150, cloud, 9))


# Redundancy and damage -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("second", "redundant"),
    [
        ((0.2, 0.1, 20), True),
        ((0.2, 0.15, 35), True),  # exactly 5 cm and 15 deg
        ((0.2, 0.151, 20), False),
        ((0.2, 0.1, 36), False),
        ((0.2, -0.1, -20), True),  # its twin is there
        ((0.2, -0.1, 20), False),
    ],
)
def test_redundancy_of_known_pairs(second: Mount, redundant: bool) -> None:
    table = design("a", [(0.2, 0.1, 20), second], mirrored=True)
    assert bool(measure_nearness(table).redundant.iloc[0]) is redundant


def test_twins_are_not_redundant_and_other_thresholds_count() -> None:
    middle = design("a", [(0.2, 0.01, 5)], mirrored=True)
    assert not measure_nearness(middle).redundant.iloc[0]
    alone = design("a", [(0.2, 0.01, 5), (0.2, -0.01, -5)])
    assert measure_nearness(alone).redundant.iloc[0]
    assert not measure_nearness(alone, near_m=0.019).redundant.iloc[0]
    assert not measure_nearness(alone, near_deg=9).redundant.iloc[0]


def test_directions_are_compared_around_the_circle() -> None:
    assert measure_nearness(design("a", [(0, 0, 175), (0, 0, -175)])).redundant.iloc[0]


def test_what_a_blow_takes_by_hand() -> None:
    """In a row at 0, 2, 7 cm: of the ends 1 + 1 + 1/3 and 1 + 2/3 + 1/3, of the middle 2 + 2/3."""
    row = measure_nearness(design("a", [(0, 0, 0), (0, 0.02, 90), (0, 0.07, 90)])).iloc[0]
    assert row.lost == pytest.approx((7 / 3 + 8 / 3 + 2) / 3)
    assert row.closest_m == pytest.approx(0.02)
    row = measure_nearness(design("a", [(0, 0, 0), (0, 0.02, 90)]), [Ring(0.01, 0.5)]).iloc[0]
    assert row.lost == pytest.approx(0.5)


@settings(max_examples=10, deadline=None)
@given(MOUNTS)
def test_what_a_blow_takes_is_what_the_failure_model_takes(mounts: list[Mount]) -> None:
    table = design("a", mounts)
    position = table[["x_m", "y_m", "z_m"]].to_numpy()
    limits = np.zeros(len(position))
    channels = Channels(limits, limits, position, 0.1)
    model, rng = SpatialFailure(), np.random.default_rng(0)
    hits = [np.isfinite(model.draw(channels, rng)[0].onset).sum() for _ in range(1500)]
    assert measure_nearness(table, paper_rings()).lost.iloc[0] == pytest.approx(
        np.mean(hits), abs=0.2
    )


@settings(max_examples=25, deadline=None)
@given(MOUNTS, st.permutations(range(5)))
def test_neither_the_mirror_nor_the_order_of_sensors_counts(
    mounts: list[Mount], order: list[int]
) -> None:
    image = [(x, -y, -yaw) for x, y, yaw in (mounts[i] for i in order if i < len(mounts))]
    one, other = measure_nearness(design("a", mounts)), measure_nearness(design("a", image))
    pd.testing.assert_frame_equal(one, other)


# All together ----------------------------------------------------------------------------------

FRONT_ARRAY, SIDES = [(0.22, 0.05, 5), (0.22, 0.1, 15)], [(0.1, 0.12, 60), (0.1, 0.14, 70)]


def spread_designs(
    rng: np.random.Generator, base: Sequence[Mount], count: int
) -> list[list[Mount]]:
    return [[(x, y, yaw + rng.normal(0, 3)) for x, y, yaw in base] for _ in range(count)]


Sensors = tuple[pd.DataFrame, pd.DataFrame]


@pytest.fixture(scope="module")
def study() -> Sensors:
    """Sensors of champions, front arrays and side mounts, and of random designs."""
    rng = np.random.default_rng(0)
    none = [*spread_designs(rng, FRONT_ARRAY, 4), *spread_designs(rng, SIDES, 4)]
    random = spread_designs(rng, SIDES, 6)
    champions = pd.concat([designs(none, "none"), designs(random, "random")], ignore_index=True)
    drawn = [[(0.1, 0.12, float(rng.uniform(0, 90))) for _ in range(2)] for _ in range(40)]
    initial = pd.concat([designs(drawn, "none"), designs(drawn[:20], "random")], ignore_index=True)
    return champions, initial


@pytest.fixture(scope="module")
def table(study: Sensors) -> pd.DataFrame:
    made: pd.DataFrame = describe_designs(*study)
    return made


@pytest.fixture(scope="module")
def numbers(table: pd.DataFrame) -> pd.DataFrame:
    made: pd.DataFrame = compare_with_random(table)
    return made


@pytest.mark.slow
def test_rates_and_clusters_are_those_that_were_made(
    table: pd.DataFrame, numbers: pd.DataFrame
) -> None:
    summary = numbers.set_index(["treatment", "measure"])
    assert summary.value[("none", FRONT)].item() == 0.5
    assert summary.value[("random", FRONT)].item() == 0
    assert summary.value[("random", SIDE)].item() == 1
    assert summary.value[("none", "clusters")].item() == 2
    assert summary.value[("random", "clusters")].item() == 1
    assert summary.value[(ALL, "clusters")].item() == 2
    row = numbers[(numbers.treatment == "random") & (numbers.measure == "redundant")].iloc[0]
    drawn = table[table.random & (table.treatment == "random")]
    near = int(drawn.redundant.sum())
    assert (row.value, row.n, row.random, row.n_random) == (1, 6, near / 20, 20)
    assert row.p == pytest.approx(stats.fisher_exact([[6, 0], [near, 20 - near]]).pvalue)
    assert row.low**6 == pytest.approx(0.025, abs=1e-5)  # exact, of all


def test_the_mean_profile_is_that_of_the_champions(study: Sensors, numbers: pd.DataFrame) -> None:
    rows = numbers[(numbers.treatment == "none") & (numbers.measure == "coverage")]
    champions = compute_profiles(study[0][study[0].treatment == "none"])
    np.testing.assert_allclose(rows.value, champions.mean())
    assert (rows.low <= rows.value).all()
    assert (rows.value <= rows.high).all()


def test_random_designs_with_other_numbers_of_sensors_are_no_baseline(study: Sensors) -> None:
    champions, initial = study
    fewer = design("single", [(0.1, 0.1, 45)], "none", mirrored=True)
    more = pd.concat([initial, fewer], ignore_index=True)
    pd.testing.assert_frame_equal(
        describe_designs(champions, initial), describe_designs(champions, more)
    )


def test_a_champion_without_sensors_is_counted(study: Sensors) -> None:
    blind = design("random999", [(math.nan, math.nan, math.nan)], "random").assign(design=math.nan)
    table = describe_designs(pd.concat([study[0], blind], ignore_index=True), study[1])
    only = table[(table.treatment == "random") & (~table.random | (table.index % 4 == 0))]
    summary = compare_with_random(only).set_index("measure")
    assert summary.value["redundant"] == pytest.approx(6 / 7)
    assert summary.n[SIDE] == 6  # it looks nowhere


@pytest.mark.slow
def test_the_order_and_the_side_of_runs_change_no_number(
    study: Sensors, numbers: pd.DataFrame
) -> None:
    shuffled = (
        study[0]
        .sample(frac=1, random_state=1)
        .assign(y_m=lambda rows: -rows.y_m, yaw_deg=lambda rows: -rows.yaw_deg)
    )
    expected, got = (
        mounted.sort_values(["treatment", "measure", "at"])
        for mounted in (numbers, compare_with_random(describe_designs(shuffled, study[1])))
    )
    pd.testing.assert_frame_equal(
        expected.reset_index(drop=True), got.reset_index(drop=True), rtol=1e-9
    )


@pytest.mark.parametrize("width", [PAGE_IN / 2, PAGE_IN])
def test_the_picture_shows_the_counts_and_the_means(
    table: pd.DataFrame, numbers: pd.DataFrame, width: float
) -> None:
    figure = draw_strategies(table, numbers, width)
    assert figure.get_figwidth() == width
    panels = [axes for part in figure.subfigs for axes in part.axes]
    (legend,) = (legend for part in figure.subfigs for legend in part.legends)
    named = [text.get_text() for text in legend.get_texts()[:2]]
    assert named == ["none (n = 8), mean", "random (n = 6), mean"]
    assert [text.get_text() for text in panels[1].texts] == ["4 : 4", "0 : 6"]
    mean = np.asarray(panels[0].get_lines()[1].get_ydata())
    rows = numbers[(numbers.treatment == "none") & (numbers.measure == "coverage")]
    np.testing.assert_allclose(mean, [*rows.value, rows.value.iloc[0]])


def test_no_two_treatments_get_one_letter() -> None:
    assert [letter(index) for index in (0, 25, 26, 51, 52)] == ["A", "Z", "AA", "ZZ", "AAA"]
    assert len({letter(index) for index in range(200)}) == 200


@pytest.mark.parametrize("operator", ["initial", "random", "sobol"])
def test_the_designs_of_a_random_first_generation_are_random_designs(operator: str) -> None:
    rows = [(0, 1, operator), (0, 2, "cma_es"), (1, 3, operator)]
    table = pd.DataFrame(rows, columns=["generation", "id", "operator"])
    assert list(select_random(table).id) == [1]


def test_without_random_designs_no_share_of_them_is_told() -> None:
    champions = design("a", [(0.2, 0.1, 0.0)])
    lines = report_designs(compare_with_random(describe_designs(champions, champions.iloc[:0])))
    assert "nan" not in " ".join(lines)
    assert "no random designs to compare with" in lines[0]


def test_a_single_ray_covers_as_much_as_a_beam_of_one_degree() -> None:
    ray = design("a", [(0.2, 0.1, 40.0)]).assign(fov_deg=0.0)
    beam = ray.assign(fov_deg=1.0)
    assert compute_profiles(ray).equals(compute_profiles(beam))
    assert compute_profiles(ray).to_numpy().sum() > 0
