"""Each claim's number is that computed by hand, and its verdict follows the data."""

import io
import itertools
import math
from collections.abc import Sequence

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from evoros.analysis.designs.features import HEADINGS_DEG
from evoros.analysis.drawing.style import save
from evoros.analysis.figures.claims import draw_claims
from evoros.analysis.statistics.finding import (
    BUILT_IN,
    NOT_SUPPORTED,
    SIZE,
    SUPPORTED,
    UNKNOWN,
    judge_above,
    judge_more,
    judge_within,
)
from evoros.analysis.statistics.small_samples import (
    Interval,
    fisher,
    ratio_interval,
    share_difference,
    share_interval,
)
from evoros.plugins.evo_ros_2018 import claims, claims_designs
from evoros.plugins.evo_ros_2018.claims import measure_swings
from evoros.plugins.evo_ros_2018.claims_designs import (
    mean_distance,
    pairwise_distances,
    relative_difference,
    resample_mean_distance,
)

# Statistics --------------------------------------------------------------------------------------


def test_the_ratio_of_sums_by_hand_and_its_interval_by_all_resamples() -> None:
    """Three replicates have 27 equally likely resamples."""
    parts, wholes = [1.0, 2, 0], [2.0, 2, 4]
    finding = ratio_interval(parts, wholes)
    assert finding.value == 3 / 8
    picks = itertools.product(range(3), repeat=3)
    item = sorted(sum(parts[i] for i in p) / sum(wholes[i] for i in p) for p in picks)
    assert (finding.low, finding.high) == (item[0], item[-1])  # with 1 in 27 each
    assert ratio_interval([1], [4]).value == 0.25
    assert math.isnan(ratio_interval([0, 0], [0, 0]).value)


@given(st.integers(0, 9), st.integers(1, 9), st.integers(0, 9), st.integers(1, 9))
def test_fishers_p_sums_the_hypergeometric_chances(a: int, m: int, b: int, n: int) -> None:
    a, b = min(a, m), min(b, n)
    chances = stats.hypergeom(m + n, a + b, m).pmf(np.arange(m + 1))
    as_rare = chances[chances <= chances[a] * (1 + 1e-7)].sum()
    assert fisher(a, m, b, n) == pytest.approx(min(as_rare, 1))


def test_a_share_of_nothing_is_not_tested_and_differs_from_none() -> None:
    assert math.isnan(share_difference(1, 2, 0, 0).value)
    assert math.isnan(fisher(0, 0, 1, 2))


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [(0.6, 0.9, SUPPORTED), (0.1, 0.4, NOT_SUPPORTED), (0.4, 0.6, UNKNOWN)],
)
def test_the_whole_interval_decides(low: float, high: float, expected: str) -> None:
    finding = Interval(0.5, low, high)
    assert judge_above(finding, 0.5) == expected
    assert judge_above(Interval(0.5, math.nan, math.nan), 0.5) == UNKNOWN
    assert judge_within(finding, 0.5, 1.0) == expected
    assert judge_within(Interval(0.5, math.nan, math.nan), 0, 1) == UNKNOWN


# Designs -----------------------------------------------------------------------------------------


def designs(
    kind: str = "random",
    redundant: Sequence[bool] = (),
    closest_m: Sequence[float] = (),
    strategy: str = "side mounts",
    at: Sequence[float] = (),
    random: bool = False,
) -> pd.DataFrame:
    """A row a design, with the columns that claims read; ``at`` is where it looks [deg]."""
    n = max(map(len, (redundant, closest_m, at)))
    marks = {"run": [f"{kind}{i}" for i in range(n)], "kind": kind, "random": random}
    frame = pd.DataFrame({**marks, "strategy": strategy})
    frame["redundant"] = list(redundant) or [False] * n
    frame["closest_m"] = list(closest_m) or [1.0] * n
    looks = [np.exp(-(((HEADINGS_DEG - yaw) / 15) ** 2)) for yaw in (at or [0.0] * n)]
    looks = [one + one[::-1] for one in looks]
    return pd.concat([frame, pd.DataFrame(looks, columns=HEADINGS_DEG)], axis=1)


def some(count: int, of: int) -> list[bool]:
    return [True] * count + [False] * (of - count)


@pytest.mark.parametrize(
    ("count", "drawn", "verdict"),
    [
        (6, 10, SUPPORTED),  # of 100: 6 of 10 are more
        (6, 40, UNKNOWN),  # no more than random designs have
        (10, 10, SUPPORTED),
        (2, 10, NOT_SUPPORTED),  # the interval ends below six of ten
        (4, 95, NOT_SUPPORTED),  # fewer than random designs
    ],
)
def test_redundancy_is_what_six_of_ten_and_random_designs_say(
    count: int, drawn: int, verdict: str
) -> None:
    table = pd.concat(
        [
            designs(redundant=some(count, 10)),
            designs(redundant=some(drawn, 100), random=True),
            designs("none", redundant=some(3, 5)),
        ]
    )
    finding = claims_designs.judge_redundancy(table)
    share = share_interval(count, 10)
    assert (finding.value, finding.low, finding.high) == (count / 10, share.low, share.high)
    assert (finding.n, finding.random) == (10, drawn / 100)
    assert finding.p == fisher(count, 10, drawn, 100)
    assert finding.verdict == verdict
    assert "3 of 5 without failure" in finding.why


@pytest.mark.parametrize(
    ("count", "verdict"),
    [(66, BUILT_IN), (49, NOT_SUPPORTED), (80, SUPPORTED), (40, NOT_SUPPORTED)],
)
def test_many_champions_decide_what_ten_leave_open(count: int, verdict: str) -> None:
    """Random designs: 60 of 100. Of 66, the difference is from -7 to 19 points."""
    champions = designs(redundant=some(count, 100))
    drawn = designs(redundant=some(600, 1000), random=True)
    assert claims_designs.judge_redundancy(pd.concat([champions, drawn])).verdict == verdict


@pytest.mark.parametrize(
    ("count", "drawn", "verdict"),
    [
        (10, 40, SUPPORTED),
        (10, 90, UNKNOWN),  # random designs have such pairs as well: from -22 to 16 points
        (10, 75, UNKNOWN),  # they may have fewer
        (0, 0, NOT_SUPPORTED),
        (5, 50, UNKNOWN),
        (6, 100, NOT_SUPPORTED),
    ],
)
def test_clusters_within_a_radius(count: int, drawn: int, verdict: str) -> None:
    def closest(near: int, of: int) -> list[float]:
        return [0.06] * near + [0.061] * (of - near)

    table = pd.concat(
        [
            designs("spatial", closest_m=closest(count, 10)),
            designs("spatial", closest_m=closest(drawn, 100), random=True),
        ]
    )
    finding = claims_designs.judge_damage_clusters(table, 0.06)
    assert (finding.value, finding.random, finding.verdict) == (count / 10, drawn / 100, verdict)
    assert ("not distinguishable from random designs" in finding.why) == (drawn in (75, 90))
    assert claims_designs.judge_damage_clusters(table, 0.05).value == 0


@pytest.mark.slow
def test_two_configurations_are_found_where_there_are_two_and_named_apart() -> None:
    rng = np.random.default_rng(0)
    front = designs("none", at=list(rng.normal(10, 2, 6)), strategy="front array")
    side = designs("random", at=list(rng.normal(70, 2, 6)))
    finding = claims_designs.judge_configurations(pd.concat([front, side], ignore_index=True))
    assert (finding.verdict, finding.n) == (SUPPORTED, 12)
    alike = [  # random designs fall into the same clusters
        designs("none", at=list(rng.normal(at, 2, 20)), random=True) for at in (10, 70)
    ]
    also = claims_designs.judge_configurations(pd.concat([front, side, *alike], ignore_index=True))
    assert (also.verdict, also.value) == (UNKNOWN, finding.value)
    assert "not distinguishable from random designs" in also.why
    assert "6 front arrays and 6 side mounts" in finding.why
    bare = front.assign(strategy=["front array"] * 5 + ["no sensors"])
    finding = claims_designs.judge_configurations(pd.concat([bare, side], ignore_index=True))
    assert "5 front arrays and 6 side mounts" in finding.why  # of 12: one has neither
    same = pd.concat([front.assign(strategy="side mounts"), side], ignore_index=True)
    assert claims_designs.judge_configurations(same).verdict == NOT_SUPPORTED
    third = designs("none", at=list(rng.normal(130, 2, 6)))
    three = pd.concat([front, side, third], ignore_index=True)
    assert claims_designs.judge_configurations(three).verdict == NOT_SUPPORTED
    verdicts = {}
    for spread in (1, 2, 4, 8):
        one = claims_designs.judge_configurations(
            designs("none", at=list(rng.normal(60, spread, 12)))
        )
        verdicts[one.p] = one.verdict
    assert min(verdicts) < 0.5 < max(verdicts)
    expected = {p: NOT_SUPPORTED if p >= 0.5 else UNKNOWN for p in verdicts}
    assert verdicts == expected  # no clusters: less clustered than most clouds, or it may be so
    few = claims_designs.judge_configurations(front.iloc[:4])
    assert (few.verdict, math.isnan(few.value)) == (UNKNOWN, True)


def test_what_is_missing_is_said() -> None:
    other, nothing = designs("stuck", redundant=[True]), pd.DataFrame(columns=["first", "last"])
    needs = {
        claims_designs.judge_redundancy(other).why,
        claims_designs.judge_damage_clusters(other, 0.03).why,
        claims_designs.judge_spread_between(other, other[:0]).why,
        claims_designs.judge_spread_within(nothing, nothing).why,
        claims.judge_approach(pd.DataFrame()).why,
        claims.judge_heading_swing(pd.DataFrame()).why,
        *(finding.why for finding in claims.judge_completion(pd.DataFrame())),
    }
    assert all(why.startswith("needs ") for why in needs)
    assert {
        "needs mirrored runs with failure=random",
        "needs runs with experiment=free_placement",
    } <= needs


# Spread ------------------------------------------------------------------------------------------


def test_distances_of_where_designs_look() -> None:
    looks = np.zeros((3, len(HEADINGS_DEG)))
    looks[0, :4], looks[1, 2:6], looks[2, :2] = 1, 3, 1  # half in common; a half of the first
    distance = pairwise_distances(pd.DataFrame(looks))
    np.testing.assert_allclose(distance, [[0, 0.5, 0.5], [0.5, 0, 1], [0.5, 1, 0]])
    assert mean_distance(distance) == pytest.approx(2 / 3)
    assert math.isnan(mean_distance(distance[:1, :1]))


def test_resamples_of_equally_distant_designs_have_that_distance() -> None:
    """A design drawn twice is no pair of designs that agree."""
    drawn = resample_mean_distance(1 - np.eye(4))
    known = drawn[~np.isnan(drawn)]
    np.testing.assert_allclose(known, 1)
    assert len(drawn) - len(known) < 0.03 * len(drawn)  # 4 of 256: one design, four times


@pytest.mark.parametrize(
    ("free", "verdict"),
    [(60.0, SUPPORTED), (2.0, NOT_SUPPORTED), (15.0, NOT_SUPPORTED), (25.0, UNKNOWN)],
)
def test_the_spread_between_runs_is_relative_to_random_designs(free: float, verdict: str) -> None:
    rng = np.random.default_rng(0)

    def table(spread: float) -> pd.DataFrame:
        champions = designs(at=list(rng.uniform(90 - spread, 90 + spread, 12)))
        drawn = designs(at=list(rng.uniform(10, 170, 60)), random=True)
        return pd.concat([champions, drawn], ignore_index=True)

    mirrored, other = table(15), table(free)
    finding = claims_designs.judge_spread_between(mirrored, other)
    ratios = [
        mean_distance(pairwise_distances(item.loc[~item.random, HEADINGS_DEG]))
        / mean_distance(pairwise_distances(item.loc[item.random, HEADINGS_DEG]))
        for item in (other, mirrored)
    ]
    assert finding.value == pytest.approx(ratios[0] - ratios[1])
    assert finding.verdict == verdict


def test_a_difference_of_spread_counts_from_a_size_on() -> None:
    assert judge_more(Interval(0.1, 0.01, 0.19)) == SUPPORTED
    assert judge_more(Interval(0.1, -0.01, SIZE - 0.01)) == NOT_SUPPORTED
    assert judge_more(Interval(0.1, -0.01, SIZE + 0.01)) == UNKNOWN
    assert judge_more(Interval(0.1)) == UNKNOWN


def test_no_difference_of_spread_is_not_exact() -> None:
    """Both sides are resampled independently, even if they are equal."""
    distances = np.abs(np.subtract.outer(np.arange(8.0), np.arange(8.0)))
    finding = relative_difference(distances, 1, distances, 1)
    assert finding.value == 0
    assert finding.low < -0.2
    assert finding.high > 0.2


def test_the_diversity_within_populations() -> None:
    kept = pd.DataFrame({"first": 1.0, "last": np.linspace(0.1, 0.2, 8)})
    more = kept.assign(last=kept["last"] + 0.5)
    finding = claims_designs.judge_spread_within(kept, more)
    assert finding.verdict == SUPPORTED
    assert finding.value == pytest.approx(0.65)
    assert finding.reference == pytest.approx(0.15)
    assert claims_designs.judge_spread_within(more, kept).verdict == NOT_SUPPORTED
    assert claims_designs.judge_spread_within(kept, kept).verdict == UNKNOWN
    many = pd.concat([kept] * 10)
    assert claims_designs.judge_spread_within(many, many).verdict == NOT_SUPPORTED


# Runs --------------------------------------------------------------------------------------------


def progress(early: Sequence[float], last: int = 24, gap: float = 0.1) -> pd.DataFrame:
    """Runs that gain 4 in all, and so much of it by generation 15."""
    rows = [
        {"last": last, **{f"{line}_{at}": value for line in claims.GAIN for at, value in item}}
        for item in ((("first", 10), ("early", 10 + one), ("last", 14)) for one in early)
    ]
    return pd.DataFrame(rows).assign(gap_first=5.0, gap_last=5.0 * gap)


@pytest.mark.parametrize(
    ("early", "verdict"),
    [([3.7, 4, 3.6] * 2, SUPPORTED), ([2, 1, 2.2] * 2, NOT_SUPPORTED), ([1, 4, 2] * 2, UNKNOWN)],
)
def test_the_gain_that_came_early(early: list[float], verdict: str) -> None:
    """More than a steady gain would have reached: 15 of 24 generations are 62.5 %."""
    finding = claims.judge_gain(progress(early), "recorded")
    assert finding.value == pytest.approx(sum(early) / 24)
    assert (finding.verdict, finding.reference) == (verdict, 0.625)


def test_a_gain_that_random_designs_reach_as_well_is_no_support() -> None:
    """Their best grows with the logarithm of their number: by generation 15, 86 % of 24."""
    finding = claims.judge_gain(progress([3.2, 3.1, 3.3] * 2), "recorded")
    assert finding.random == pytest.approx(math.log(16) / math.log(25))
    assert finding.reference < finding.low < finding.random
    assert finding.verdict == BUILT_IN
    assert "not distinguishable from random designs" in finding.why


def test_runs_of_seven_generations_are_told_how_to_get_enough() -> None:
    finding = claims.judge_gain(progress([3.5, 3.5], last=6), "recorded")
    assert "two mirrored runs of 17 generations or more, recorded; the longest has 7" in finding.why
    enough = progress([3.5, 3.5], last=16)  # generations 0 to 16 are 17
    assert "needs" not in claims.judge_gain(enough, "recorded").why


def test_a_gain_that_may_be_none_says_nothing() -> None:
    table = progress([3.5, 3.5, 3.5])
    table["validated_last"] = [14.0, 6, 11]
    finding = claims.judge_gain(table, "validated")
    assert (finding.verdict, math.isnan(finding.value)) == (UNKNOWN, True)
    assert "which does not prove a gain" in finding.why
    assert "needs" in claims.judge_gain(table.assign(validated_last=math.nan), "validated").why
    assert "needs" in claims.judge_gain(progress([3.5, 3.5], last=15), "recorded").why
    without_runs = pd.DataFrame()  # as of a study in which no design is mirrored
    assert "needs" in claims.judge_gain(without_runs, "recorded").why


@pytest.mark.parametrize(
    ("gap", "verdict"), [(0.2, SUPPORTED), (0.8, NOT_SUPPORTED), (1.5, NOT_SUPPORTED)]
)
def test_the_mean_approaches_the_best(gap: float, verdict: str) -> None:
    finding = claims.judge_approach(progress([3] * 6, gap=gap))
    assert finding.value == pytest.approx(gap)
    assert finding.verdict == verdict


def drive(
    seconds: float,
    peak_deg: float = 30.0,
    turn_deg: float = 0.0,
    visited: object = 0,
    period_s: float = 9.7,
) -> pd.DataFrame:
    """A heading that weaves while it turns steadily, across +-180 deg."""
    times = np.arange(0, seconds, 0.1)
    yaw = 170 + peak_deg * np.sin(2 * np.pi * times / period_s) + turn_deg * times
    wrapped = np.radians((yaw + 180) % 360 - 180)
    columns = {"time_s": times, "yaw_rad": wrapped, "mode": 2, "visited": visited}
    return pd.DataFrame(columns)


@pytest.mark.parametrize("period", [6.0, 9.7, 14.0])
@pytest.mark.parametrize(("peak", "turn"), [(30, 0), (30, 2), (10, 0), (10, -0.5)])
def test_the_sweep_of_a_weave_is_twice_its_amplitude_whatever_the_course_and_the_period(
    peak: float, turn: float, period: float
) -> None:
    finding = measure_swings(drive(60, peak, turn, period_s=period), 2)
    # A turning point every half a period, of which the first counts not, and one at each end.
    assert len(finding) == pytest.approx(2 * 60 / period - 3, abs=1)
    share = turn / (peak * 2 * np.pi / period)
    np.testing.assert_allclose(finding, 2 * peak * (1 + share**2 / 2), rtol=0.005)


def test_a_steady_turn_and_small_corrections_are_no_weave() -> None:
    assert measure_swings(drive(60, 0, 5), 2) == []
    assert measure_swings(drive(60, 1.4), 2) == []  # 2.8 deg from peak to peak
    assert len(measure_swings(drive(60, 1.6), 2)) > 0


def test_only_navigation_between_waypoints_counts() -> None:
    """50 s have ten turning points, the first 2.4 s after the begin, then every 4.85 s."""
    whole = drive(50)
    assert measure_swings(whole, 1) == []
    assert len(measure_swings(whole, 2)) == 7
    assert measure_swings(drive(16), 2) == []  # three of them, of which the first does not count
    assert len(measure_swings(drive(18), 2)) == 1
    avoiding = whole.assign(mode=np.where(whole.time_s.between(20, 20.5), 1, 2))
    assert len(measure_swings(avoiding, 2)) == 1 + 3  # four before it, six behind it
    reached = drive(50, visited=np.arange(500) // 250)
    assert len(measure_swings(reached, 2)) == 2 + 2
    assert measure_swings(whole.iloc[:1], 2) == []


@pytest.mark.parametrize(
    ("deg", "verdict"), [(58.0, SUPPORTED), (20.0, NOT_SUPPORTED), (100, NOT_SUPPORTED)]
)
def test_the_sweep_is_the_median_of_runs(deg: float, verdict: str) -> None:
    """A run with many weaves counts once."""
    rows = [("long", 300.0)] * 50 + [(run, deg) for run in "abcdefgh" for _ in range(3)]
    finding = claims.judge_heading_swing(pd.DataFrame(rows, columns=["run", "swing_deg"]))
    assert (finding.value, finding.n, finding.verdict) == (deg, 9, verdict)


def test_a_swing_that_the_controller_makes_is_built_in() -> None:
    rows = pd.DataFrame([(run, 58.0) for run in "abcdefgh"], columns=["run", "swing_deg"])
    finding = claims.judge_heading_swing(rows, built_in=True)
    assert finding.verdict == BUILT_IN
    assert "weaves by design" in finding.why


def flown(run: str, completed: int, failed: int, before: int = 0) -> pd.DataFrame:
    """Make missions with a failed sensor, some completed, and some that ended before it failed."""
    done = some(completed, failed) + [False] * before
    hit = [True] * failed + [False] * before
    marks = {"kind": "random", "source": "here", "run": run}
    return pd.DataFrame({**marks, "failed": hit, "completed": done})


def test_missions_count_after_a_failure_and_runs_are_the_replicates() -> None:
    table = pd.concat([flown("a", 9, 10, 3), flown("b", 18, 20), flown("c", 10, 10)])
    first, second = claims.judge_completion(table)
    assert first.value == pytest.approx(37 / 40)
    assert (first.low, first.high) == pytest.approx((0.9, 1))
    assert (first.n, first.verdict) == (3, UNKNOWN)
    assert first.why.endswith("3 replicates")
    assert "37 of 40" in first.why
    assert "3 ended before" in first.why
    assert second.why == "needs validated runs with failure=spatial"


@pytest.mark.parametrize(
    ("counts", "verdict"),
    [([9] * 6, SUPPORTED), ([1] * 6, NOT_SUPPORTED), ([0, 10] * 4, UNKNOWN), ([9] * 5, UNKNOWN)],
)
def test_most_missions_are_completed_or_not(counts: list[int], verdict: str) -> None:
    """Sixty missions of which all or none of a champion are completed say little."""
    table = pd.concat([flown(str(i), count, 10) for i, count in enumerate(counts)])
    assert next(iter(claims.judge_completion(table))).verdict == verdict


@pytest.mark.parametrize(("drawn", "verdict"), [(4, SUPPORTED), (9, UNKNOWN), (None, SUPPORTED)])
def test_missions_that_random_designs_complete_as_well_are_no_support(
    drawn: int | None, verdict: str
) -> None:
    champions = pd.concat([flown(str(i), 9, 10) for i in range(8)])
    random = None if drawn is None else flown("x", drawn, 10, 5)
    finding = next(iter(claims.judge_completion(champions, random)))
    assert finding.verdict == verdict
    assert math.isnan(finding.random) if drawn is None else finding.random == drawn / 10


@pytest.mark.parametrize("kind", ["pdf", "svg", "png"])
def test_the_same_table_gives_the_same_bytes(kind: str) -> None:
    finding = claims_designs.judge_redundancy(designs(redundant=some(6, 10)))
    table = pd.DataFrame([finding.__dict__])
    first, second = io.BytesIO(), io.BytesIO()
    save(draw_claims(table), first, kind)
    save(draw_claims(table.copy()), second, kind)
    assert first.getvalue() == second.getvalue()
