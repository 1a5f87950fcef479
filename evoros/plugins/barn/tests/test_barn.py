"""BARN worlds, drawn and from files: the automaton, the corridor, the shortest way, the files."""

import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from evoros import compose
from evoros.base.errors import InputError
from evoros.base.rng import generator
from evoros.design.design import Design
from evoros.formats.sdf.reader import read_sdf
from evoros.geometry.footprint import distances, project_bodies
from evoros.geometry.free_space import Cells
from evoros.mission.mission import COMPLETED, Mission
from evoros.mission.rollout import run_mission
from evoros.plugins.barn.field import (
    CELL_M,
    PATHS,
    RADIUS_M,
    REACH,
    SIDE,
    BarnField,
    _count_neighbours,
    build_cylinders,
    draw_grids,
    find_free,
    find_shortest,
    generate_barn,
    has_corridor,
    load_barn,
    locate,
    measure_way,
    read_grid,
)
from evoros.plugins.barn.fitness import score_mission
from evoros.world.course import Course

GRIDS = arrays(np.bool_, (SIDE, SIDE))
FILL, SMOOTHINGS = [0.15, 0.2, 0.25], [2, 3, 4]
HOME, GOAL = (-2.25, 3.0), (-2.25, 13.0)
KEYS = st.text("abc/0123456789", min_size=1, max_size=8)


def crossing() -> Course:
    return Course(*HOME, 0.02, 1.570796, [GOAL], 1.0, 100.0, "one_way", True)


def field(seed: int = 0) -> BarnField:
    return BarnField(crossing(), FILL, SMOOTHINGS, seed)


@given(GRIDS)
def test_neighbours_are_counted_one_by_one(cells: Cells) -> None:
    counts = _count_neighbours(cells[None])[0]
    for row, column in ((0, 0), (0, 7), (SIDE - 1, SIDE - 1), (12, 0), (5, SIDE - 1), (8, 8)):
        expected = 0
        for i in (row - 1, row, row + 1):
            for j in (column - 1, column, column + 1):
                if not 0 <= i < SIDE:
                    expected += 1  # beyond the walls
                elif 0 <= j < SIDE and (i, j) != (row, column):
                    expected += bool(cells[i, j])
        assert counts[row, column] == expected


@given(st.sampled_from([0.15, 0.2, 0.25, 0.3]), st.integers(0, 99))
def test_as_many_cells_are_filled_as_stated(fill: float, seed: int) -> None:
    grids = draw_grids(40, fill, 0, generator(str(seed), "test"))
    assert grids[:, [0, -1]].all()
    inner = grids[:, 1:-1]
    deviation = math.sqrt(fill * (1.0 - fill) / inner.size)
    assert abs(inner.mean() - fill) < 6.0 * deviation


def test_a_filled_grid_stays_and_a_lone_cell_goes() -> None:
    nothing = draw_grids(1, 0.0, 3, generator("a", "test"))[0]
    assert not nothing[2:-2].any()
    assert nothing[[0, -1], 1:-1].all()
    assert draw_grids(1, 1.0, 3, generator("a", "test")).all()


@given(GRIDS)
def test_a_place_is_free_if_no_cell_around_it_is_filled(cells: Cells) -> None:
    free = find_free(cells)
    filled = np.argwhere(cells)
    for place in np.argwhere(np.ones_like(cells))[::37]:
        apart = np.abs(filled - place).max(axis=1) if len(filled) else np.array([SIDE])
        assert free[*place] == (apart.min() > REACH)


@settings(max_examples=20)
@given(KEYS, st.integers(0, 9))
def test_the_shortest_way_of_a_drawn_world_is_free_for_the_robot(draws: str, seed: int) -> None:
    one = field(seed)
    cells = one.draw_grid(draws)
    free = find_free(cells)
    assert has_corridor(free)
    way = find_shortest(free, HOME, GOAL)
    assert (way[0], way[-1]) == (HOME, GOAL)
    assert measure_way(way) == one.measure_shortest(cells) >= math.dist(HOME, GOAL)
    inside = np.array([a + (b - a) * t for a, b in pairwise(np.array(way[1:-1])) for t in (0, 0.5)])
    # Cells 3 apart are 0.45 m apart; in the middle of a diagonal step half a cell less.
    clear = (REACH + 1 - 0.5) * CELL_M - RADIUS_M
    for area in project_bodies([*build_cylinders(cells)]):
        assert distances(area, inside).min() >= clear - 1e-9


def test_the_shortest_way_has_the_length_of_its_parts() -> None:
    free = np.zeros((SIDE, SIDE), dtype=np.bool_)
    assert find_shortest(free, HOME, GOAL) == []
    free[4] = True  # one lane
    ends = math.dist(HOME, locate(4, 0)) + math.dist(locate(4, SIDE - 1), GOAL)
    straight = (SIDE - 1) * CELL_M
    assert measure_way(find_shortest(free, HOME, GOAL)) == pytest.approx(ends + straight)
    free[4, 10:], free[5, 9:] = False, True  # to the lane beside it, by one diagonal step
    ends = math.dist(HOME, locate(4, 0)) + math.dist(locate(5, SIDE - 1), GOAL)
    bent = straight + (math.sqrt(2.0) - 1.0) * CELL_M
    assert measure_way(find_shortest(free, HOME, GOAL)) == pytest.approx(ends + bent)
    free[5, 9] = False  # now the step leads between two cells that are not free
    assert find_shortest(free, HOME, GOAL) == []


@settings(max_examples=10)
@given(KEYS)
def test_draws_and_seed_determine_a_world_and_its_sdf_is_it(draws: str) -> None:
    world = field().draw_world(draws)
    again = generate_barn(crossing(), FILL, SMOOTHINGS).at(draws)
    assert world == again
    assert world.sdf == again.sdf
    assert read_sdf(world.sdf.encode(), "again").bodies == world.bodies
    assert (field(1).draw_grid(draws) != field().draw_grid(draws)).any()


@settings(max_examples=10)
@given(KEYS)
def test_a_world_has_the_published_places(draws: str) -> None:
    world = field().draw_world(draws)
    places = np.array([body.pose.position[:2] for body in world.obstacles])
    assert places.min(axis=0).tolist() == [-4.425, 0.075]
    assert places.max(axis=0)[0] == -0.075
    assert places.max(axis=0)[1] <= 9.525
    cells = field().draw_grid(draws)
    read = read_grid(world.obstacles)
    assert (find_free(read) == find_free(cells)).all()  # cells among filled ones have no cylinder
    assert not (read & ~cells).any()


@pytest.mark.parametrize(
    ("changes", "rule"),
    [
        ({"fill": []}, "BarnField.fill: must be a list"),
        ({"fill": [1.5]}, "BarnField.fill"),
        ({"smoothings": [0]}, "BarnField.smoothings"),
        ({"renew": 1}, "generate_barn.renew"),
    ],
)
def test_bad_values_are_refused(changes: dict[str, object], rule: str) -> None:
    values: dict[str, object] = {"course": crossing(), "fill": FILL, "smoothings": SMOOTHINGS}
    with pytest.raises(InputError, match=rule):
        generate_barn(**values | changes)  # type: ignore[arg-type]


def test_trial_n_drives_in_file_n(tmp_path: Path) -> None:
    drawn = [field().draw_world(str(i)) for i in range(3)]
    for number, world in zip((10, 2, 0), drawn, strict=True):
        (tmp_path / f"world_{number}.world").write_text(world.sdf)
    (tmp_path / PATHS).mkdir()
    cells = np.array([[15, 0], [15, 29]])
    np.save(tmp_path / PATHS / "path_2.npy", cells)
    loaded = load_barn(str(tmp_path), crossing())
    assert loaded.at("0/evaluation/0/barn_files/0").obstacles == drawn[2].obstacles
    assert loaded.at("0/evaluation/7/barn_files/2").obstacles == drawn[0].obstacles
    assert loaded.at("0/evaluation/0/barn_files/5").obstacles == drawn[0].obstacles  # again
    assert loaded.at("0/evaluation/0/barn_files/2").shortest_m == pytest.approx(
        drawn[0].shortest_m or 0.0
    )
    # As the challenge measures a path: cell (r, c) is at (0.15 r - 4.575, 0.15 c + 5.075).
    first, last = (-2.325, 5.075), (-2.325, 9.425)
    way = [HOME, first, last, GOAL]
    length = math.fsum(math.dist(a, b) for a, b in pairwise(way))
    assert loaded.at("0/evaluation/0/barn_files/1").shortest_m == pytest.approx(length)


def test_a_folder_without_worlds_and_a_bad_path_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no files named world_N\.world were found"):
        load_barn(str(tmp_path), crossing())
    (tmp_path / "world_0.world").write_text(field().draw_world("a").sdf)
    (tmp_path / PATHS).mkdir()
    (tmp_path / PATHS / "path_0.npy").write_bytes(b"no array")
    with pytest.raises(InputError, match=r"path_0\.npy: not an array of cells"):
        load_barn(str(tmp_path), crossing())


@pytest.mark.slow
def test_a_hand_made_robot_arrives_and_scores() -> None:
    experiment = compose(["experiment=barn_gap"]).build()
    design: Design = experiment.space.decode(np.full(experiment.space.size, 0.5))
    mission = Mission(0, 0, design, "barn", 0, "selection", "easy/0")
    (outcome,), trajectory = run_mission(experiment.scenario, mission)
    world = experiment.world["barn"].at("easy/0")
    assert outcome.shortest_m == world.shortest_m is not None
    assert outcome.ended == COMPLETED
    assert outcome.visited == 1
    assert outcome.least_waypoint_distances_m[0] <= 1.0  # it ends there, without a way back
    assert 0.125 <= score_mission(outcome) <= 0.5
    late = replace(experiment.world["barn"].course, time_limit_s=2.0)
    assert late.route(True).shape == (1, 2)
    assert len(trajectory) > 10
