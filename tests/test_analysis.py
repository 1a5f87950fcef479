"""The figures show the numbers of the tables."""

import io
import math

import numpy as np
import pandas as pd
import pytest
from evoros.analysis.fitness import fitness
from evoros.analysis.style import save
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.figure import Figure

NAN = math.nan
TABLE = pd.DataFrame(
    {
        "generation": [0, 0, 0, 1, 1, 2],
        "fitness": [1.0, 4.0, 2.5, 4.0, 3.0, 5.5],
        "validated_fitness": [NAN, 3.25, NAN, 3.25, NAN, 4.5],
    }
)
BEST, MEAN, VALIDATED = [4.0, 4.0, 5.5], [2.5, 3.5, 5.5], [3.25, 3.25, 4.5]


def lines(figure: Figure) -> dict[str, list[tuple[float, float]]]:
    """The points (x, y) of each line, by its name in the legend."""
    (axes,) = figure.axes
    return {
        str(line.get_label()): [(float(x), float(y)) for x, y in np.asarray(line.get_xydata())]
        for line in axes.get_lines()
    }


def points(axes: Axes) -> list[tuple[float, float]]:
    (drawn,) = (item for item in axes.collections if isinstance(item, PathCollection))
    return [(float(x), float(y)) for x, y in np.asarray(drawn.get_offsets())]


def saved(table: pd.DataFrame, kind: str) -> bytes:
    file = io.BytesIO()
    save(fitness(table), file, kind)
    return file.getvalue()


def test_each_line_is_that_of_the_table_computed_by_hand() -> None:
    expected = {"best, recorded": BEST, "mean of pool": MEAN, "best, validated": VALIDATED}
    assert lines(fitness(TABLE)) == {
        name: list(enumerate(values)) for name, values in expected.items()
    }


def test_every_row_is_a_point() -> None:
    (axes,) = fitness(TABLE).axes
    rows = zip(TABLE["generation"], TABLE["fitness"], strict=True)
    assert sorted(points(axes)) == sorted((float(x), float(y)) for x, y in rows)


def test_the_order_of_the_rows_changes_no_line() -> None:
    assert lines(fitness(TABLE.iloc[::-1])) == lines(fitness(TABLE))


def test_without_validation_there_is_no_line_of_it() -> None:
    drawn = lines(fitness(TABLE.assign(validated_fitness=NAN)))
    assert set(drawn) == {"best, recorded", "mean of pool"}


def test_generations_are_whole_and_named_in_the_axes() -> None:
    (axes,) = fitness(TABLE).axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("generation", "fitness (Eq. 1)")
    assert all(float(tick).is_integer() for tick in axes.get_xticks())


@pytest.mark.parametrize("width", [3.5, 7.0])
def test_the_figure_is_as_wide_as_asked(width: float) -> None:
    assert fitness(TABLE, width).get_figwidth() == width


@pytest.mark.parametrize("kind", ["svg", "pdf", "png"])
def test_the_same_table_gives_the_same_bytes(kind: str) -> None:
    first = saved(TABLE, kind)
    assert saved(TABLE.copy(), kind) == first
    assert saved(TABLE.assign(fitness=TABLE["fitness"] + 1), kind) != first
