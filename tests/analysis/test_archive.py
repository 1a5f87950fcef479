"""Archives and fronts from tables whose elites are known."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from evoros.analysis.drawing.gallery import choose_apart, draw_in_cells
from evoros.analysis.tables.elites import (
    Axis,
    Grid,
    find_elites,
    find_front,
    take_latest,
    trace_growth,
)
from evoros.storage.figure_context import FigureContext, Part

GRID: Grid = (
    Axis("descriptors.a", "a", (0.0, 1.0), 1.0),
    Axis("descriptors.b", "b", (0.0, 2.0), 1.0),
    2,
)


def table(*rows: tuple[int, int, float, float, float]) -> pd.DataFrame:
    columns = ["generation", "id", "descriptors.a", "descriptors.b", "fitness"]
    return pd.DataFrame(list(rows), columns=columns)


def test_a_cell_has_the_fittest_design_and_those_beyond_the_bounds_are_at_the_edge() -> None:
    rows = table((0, 1, 0.1, 0.1, 3.0), (0, 2, 0.4, 0.9, 5.0), (0, 3, 7.0, -1.0, 1.0))
    elites = find_elites(rows, GRID)
    assert list(elites.id) == [2, 3]
    assert elites[["cell_x", "cell_y"]].to_numpy().tolist() == [[0, 0], [1, 0]]
    equal = table((0, 9, 0.1, 0.1, 3.0), (0, 4, 0.1, 0.1, 3.0))
    assert list(find_elites(equal, GRID).id) == [4]  # the first of equals


def test_the_archive_grows_with_the_missions_and_counts_the_latest_scores() -> None:
    rows = table(
        (0, 1, 0.1, 0.1, 3.0), (0, 2, 0.9, 0.1, 4.0), (1, 3, 0.9, 1.9, 2.0), (1, 2, 0.9, 0.1, 1.0)
    )
    growth = trace_growth(rows, pd.Series({0: 6, 1: 9}), GRID)
    assert list(growth.missions) == [6, 9]
    assert list(growth.coverage) == [2 / 4, 3 / 4]
    assert list(growth.qd_score) == [7.0, 3.0 + 2.0 + 1.0]
    assert list(take_latest(rows).fitness) == [3.0, 2.0, 1.0]


@given(st.lists(st.tuples(st.integers(0, 5), st.integers(0, 5)), min_size=1, max_size=12))
def test_a_front_is_what_nothing_dominates(points: list[tuple[int, int]]) -> None:
    values = np.array(points, dtype=float)
    front = {points[i] for i in np.flatnonzero(find_front(values))}
    assert front
    for point in points:
        dominated = any(q != point and q[0] >= point[0] and q[1] >= point[1] for q in points)
        assert (point in front) == (not dominated)


def test_designs_that_are_drawn_lie_apart() -> None:
    points = np.array([[0.0, 0.0], [0.1, 0.0], [1.0, 1.0], [1.0, 0.0]])
    assert choose_apart(points, 3)[:2] == [0, 2]
    assert len(choose_apart(np.zeros((4, 2)), 3)) == 1
    assert choose_apart(points[:1], 6) == [0]


def test_the_front_of_one_objective_is_its_best() -> None:
    assert np.flatnonzero(find_front(np.array([[1.0], [3.0], [2.0]]))).tolist() == [1]
    with pytest.raises(ValueError, match="axis"):
        find_front(np.array([1.0, 2.0]))


def test_a_design_in_a_cell_is_in_it_with_its_nose_up_and_its_left_on_the_left() -> None:
    box = ((-0.2, -0.1), (0.2, -0.1), (0.2, 0.1), (-0.2, 0.1))
    parts = (Part("base", box, 0.0, 0.1, False),)
    context = FigureContext("box", parts, {}, {}, {}, True, (), (), {})
    row = {"type": "sonar", "fov_deg": 20.0, "range_m": 4.0, "yaw_deg": 90.0}
    sensors = pd.DataFrame([{**row, "x_m": 0.15, "y_m": 0.1}])
    axes = Figure().add_subplot()
    centre, side = np.array([[3.0, 40.0]]), np.array([2.0, 10.0])
    draw_in_cells(axes, centre, side, [sensors], context)
    (drawn,) = [artist for artist in axes.collections if isinstance(artist, PolyCollection)]
    cone, body = [(path.vertices - centre) / side for path in drawn.get_paths()]
    for outline in (cone, body):
        assert np.abs(outline).max() <= 0.5
    assert cone[:, 0].min() < body[:, 0].min()  # reaches out to the left
    assert cone[0, 1] > 0 > body[:, 1].min()  # from the front half
    lengths = np.ptp(body, axis=0)
    assert lengths[1] == pytest.approx(2 * lengths[0])  # to scale
