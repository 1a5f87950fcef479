"""Covers are optimal, survive failures, and leave everything else to the search."""

from functools import cache
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evoros.base.errors import InputError
from evoros.config.compose import compose
from evoros.design.team import TeamSpace
from evoros.optimizer.protocol import Individual
from evoros.optimizer.set_cover import ALL_AROUND, BEARINGS, Program, SetCover
from evoros.robot.seen import BEARINGS_DEG, find_seen
from evoros.testing.optimizer import GOALS, THREE_SENSORS, sphere, step

FEW = {"candidates": 80, "covers": 3, "population_size": 6}


@cache
def space(*overrides: str) -> TeamSpace:
    return compose(overrides).build().space


def draw(optimizer: SetCover, searched: TeamSpace, generations: int = 1) -> list[Individual]:
    search = optimizer.start(searched, GOALS, np.random.default_rng(5))
    return [one for _ in range(generations) for one in step(search, sphere)[0]]


def see(searched: TeamSpace, one: Individual, distance_m: float = 2.0) -> np.ndarray:
    (alone,) = searched.spaces.values()
    mounts = alone.decode(one.genome).mounts
    return find_seen(alone.robot.with_sensors(mounts, alone.design.sensors), distance_m)


@st.composite
def programs(draws: st.DrawFn) -> tuple[Program, float, np.ndarray]:
    n = draws(st.integers(1, 7))
    counts = np.zeros((ALL_AROUND, n))
    for place in range(n):
        start, width = draws(st.integers(120, 220)), draws(st.integers(5, 60))
        counts[start : start + width, place] = draws(st.sampled_from([1, 2]))
    prices = np.array(draws(st.lists(st.integers(1, 9), min_size=n, max_size=n)), dtype=float)
    low = draws(st.integers(0, n))
    number = (low, draws(st.integers(low, n)))
    places = draws(st.lists(st.sampled_from(["", "a", "b"]), min_size=n, max_size=n))
    needed = np.full(ALL_AROUND, draws(st.sampled_from([0, 1, 2])))
    return (
        Program(counts, needed, prices, number, places),
        draws(st.sampled_from([2.0, 20.0, 50.0])),
        prices,
    )


@settings(max_examples=60)
@given(programs())
def test_no_set_is_cheaper(case: tuple[Program, float, np.ndarray]) -> None:
    program, width, prices = case
    sector = np.abs(BEARINGS) <= width / 2
    low, high = program.number
    sums = [
        prices[list(chosen)].sum()
        for size in range(low, high + 1)
        for chosen in combinations(range(len(prices)), size)
        if all([program.places[i] for i in chosen].count(place) < 2 for place in "ab")
        and np.all((program.counts[:, list(chosen)].sum(axis=1) >= program.needed)[sector])
    ]
    cover = program.solve(width, prices)
    if cover is None:
        assert not sums
    else:
        assert prices[cover].sum() == min(sums)


def test_bearings_are_those_of_a_view() -> None:
    np.testing.assert_array_equal(BEARINGS, BEARINGS_DEG)


@pytest.mark.parametrize("failed", [0, 1, 2])
@pytest.mark.parametrize("design", ["six_sonars", "free_sonars"])
def test_every_bearing_is_seen_after_any_failure(design: str, failed: int) -> None:
    searched = space(f"design={design}")
    sector = np.abs(BEARINGS_DEG) <= 20
    for one in draw(SetCover(width_deg=40.0, failed=failed, **FEW), searched):
        seen = see(searched, one)
        for lost in combinations(range(len(seen)), failed):
            left = np.delete(seen, lost, axis=0)[:, sector]
            assert left.any(axis=0).all()


def test_the_widest_sector_needs_all_sensors_and_no_wider_one_is_feasible() -> None:
    searched = space("design=six_sonars")
    one = draw(SetCover(**FEW), searched)[0]
    once = see(searched, one).sum(axis=0) < 2
    width = 2 * np.abs(BEARINGS_DEG[once]).min() - 1  # in which all are seen twice
    assert draw(SetCover(width_deg=float(width), **FEW), searched)
    with pytest.raises(InputError, match="width_deg"):
        draw(SetCover(width_deg=float(width + 1), **FEW), searched)


def test_all_covers_have_the_least_price_and_number() -> None:
    searched = space("design=priced_sensors", "controller=neural")
    (alone,) = searched.spaces.values()
    priced = set()
    for one in draw(SetCover(width_deg=60.0, **FEW), searched, 3):
        mounts = alone.decode(one.genome).mounts
        priced.add((sum(alone.design.sensors[m.sensor].price for m in mounts), len(mounts)))
    assert len(priced) == 1
    cheaper = SetCover(width_deg=50.0, **FEW)
    mounts = alone.decode(draw(cheaper, searched)[0].genome).mounts
    assert sum(alone.design.sensors[m.sensor].price for m in mounts) <= min(priced)[0]


@pytest.mark.parametrize("number", ["4", "[2,4]"])
@pytest.mark.parametrize("width_deg", [4.0, 30.0, 60.0])
def test_a_place_that_carries_one_sensor_counts_once(number: str, width_deg: float) -> None:
    """Of all sets of places, none with fewer sensors covers the sector."""
    searched = space("design=places", f"design.number={number}")
    (alone,) = searched.spaces.values()
    ends = [region.ranges["x_m"] for region in alone.regions.values()]
    assert all(low == high for low, high in ends)  # so all sensors of a place are the same
    genome = np.zeros(searched.size)
    levels, seen = len(alone.regions), []
    for place in range(levels):
        genome[searched.slots[0].genes[0]] = (place + 0.5) / levels
        (mount,) = alone.mount_slots(genome)[0][0]
        robot = alone.robot.with_sensors([mount], alone.design.sensors)
        seen.append(find_seen(robot, 2.0).sum(axis=0))
    sector = np.abs(BEARINGS_DEG) <= width_deg / 2
    least = next(
        size
        for size in range(1, 5)
        for chosen in combinations(seen, size)
        if np.all(sum(chosen)[sector] >= 1)
    )
    for one in draw(SetCover(width_deg=width_deg, failed=0, **FEW), searched):
        assert len(alone.decode(one.genome).mounts) == least
        assert see(searched, one)[:, sector].any(axis=0).all()


def test_sensors_stay_while_all_other_genes_evolve() -> None:
    searched = space("design=six_sonars", "controller=neural")
    taken = {gene for slot in searched.slots for gene in slot.genes}
    others = [gene for gene in range(searched.size) if gene not in taken]
    found = draw(SetCover(width_deg=40.0, **FEW), searched, 6)
    bodies = {tuple(one.genome[sorted(taken)]) for one in found}
    assert 1 <= len(bodies) <= 3
    assert all(len({one.genome[gene] for one in found}) > len(bodies) for gene in others)


def refuse(optimizer: SetCover, searched: object) -> str:
    with pytest.raises(InputError) as caught:
        optimizer.start(searched, GOALS, np.random.default_rng(0))  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_a_sector_that_is_too_wide_is_refused_in_one_line() -> None:
    message = refuse(SetCover(width_deg=180.0, **FEW), space("design=six_sonars"))
    assert message.startswith("optimizer.width_deg: ")
    assert "covers a sector of 180 deg" in message
    assert "; lower optimizer.width_deg" in message
    refuse(SetCover(width_deg=180.0, failed=3, candidates=3, covers=1), THREE_SENSORS)


def test_a_space_that_knows_no_views_is_refused_in_one_line() -> None:
    assert "view" in refuse(SetCover(), object())


def test_several_designs_are_refused_in_one_line() -> None:
    (alone,) = space("design=six_sonars").spaces.values()
    assert "one robot" in refuse(SetCover(), TeamSpace({"": alone, "other": alone}))
