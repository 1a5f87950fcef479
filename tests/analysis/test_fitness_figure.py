"""The figures show the numbers of the tables."""

import io
import math
from typing import Any

import numpy as np
import pandas as pd
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.figure import Figure

from evoros.analysis.drawing.style import save
from evoros.analysis.figures.fitness import draw_fitness
from evoros.analysis.statistics.small_samples import Interval
from evoros.analysis.tables.costs import compute_quartiles
from evoros.analysis.tables.designs import select_bests

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
    save(draw_fitness(table), file, kind)
    return file.getvalue()


def test_each_line_is_that_of_the_table_computed_by_hand() -> None:
    expected = {"best, recorded": BEST, "mean of pool": MEAN, "best, validated": VALIDATED}
    assert lines(draw_fitness(TABLE)) == {
        name: list(enumerate(values)) for name, values in expected.items()
    }


def test_every_row_is_a_point() -> None:
    (axes,) = draw_fitness(TABLE).axes
    rows = zip(TABLE["generation"], TABLE["fitness"], strict=True)
    assert sorted(points(axes)) == sorted((float(x), float(y)) for x, y in rows)


def test_the_order_of_the_rows_changes_no_line() -> None:
    assert lines(draw_fitness(TABLE.iloc[::-1])) == lines(draw_fitness(TABLE))


def test_without_validation_there_is_no_line_of_it() -> None:
    drawn = lines(draw_fitness(TABLE.assign(validated_fitness=NAN)))
    assert set(drawn) == {"best, recorded", "mean of pool"}


@pytest.mark.parametrize("table", [TABLE, pd.concat([TABLE.assign(run="a", treatment="calm")])])
@pytest.mark.parametrize("label", ["fitness (Eq. 1)", "way [m]"])
def test_generations_are_whole_and_named_in_the_axes(table: pd.DataFrame, label: str) -> None:
    (axes,) = draw_fitness(table, label=label).axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("generation", label)
    assert draw_fitness(table).axes[0].get_ylabel() == "fitness"
    assert all(float(tick).is_integer() for tick in axes.get_xticks())


@pytest.mark.parametrize("kind", ["svg", "pdf", "png"])
def test_the_same_table_gives_the_same_bytes(kind: str) -> None:
    first = saved(TABLE, kind)
    assert saved(TABLE.copy(), kind) == first
    assert saved(TABLE.assign(fitness=TABLE["fitness"] + 1), kind) != first


def replicate(run: str, treatment: str, best: list[float], validated: list[float]) -> pd.DataFrame:
    """A run with two candidates in each generation: the best, and one with a fitness of 1."""
    count = len(best)
    return pd.DataFrame(
        {
            "run": run,
            "treatment": treatment,
            "generation": [*range(count), *range(count)],
            "fitness": [*best, *(1.0 for _ in best)],
            "validated_fitness": [*validated, *(NAN for _ in best)],
        }
    )


STUDY = pd.concat(
    [
        replicate("a", "calm", [2.0, 3.0], [2.0, NAN]),
        replicate("b", "calm", [4.0, 5.0], [4.0, 1.0]),
        replicate("c", "calm", [6.0], [6.0]),  # unfinished
        replicate("d", "calm", [20.0, 9.0], [0.0, 2.0]),
        replicate("e", "storm", [8.0, 8.0], [NAN, NAN]),
    ]
)


def test_quartiles_over_the_replicates_are_those_computed_by_hand() -> None:
    """2, 4, 6, 20 have 3.5, 5, 9.5 by linear interpolation; with those runs that are there."""
    table: Any = compute_quartiles(STUDY).set_index(["treatment", "generation"])
    calm, later = table.loc[("calm", 0)], table.loc[("calm", 1)]
    assert calm[["recorded_q1", "recorded_median", "recorded_q3"]].tolist() == [3.5, 5.0, 9.5]
    assert calm[["validated_q1", "validated_median", "validated_q3"]].tolist() == [1.5, 3.0, 4.5]
    assert calm["mean_median"] == 3.0  # of (2 + 1) / 2, 2.5, 3.5, 10.5
    assert later[["recorded_q1", "recorded_median", "recorded_q3"]].tolist() == [4.0, 5.0, 7.0]
    assert later[["validated_q1", "validated_median", "validated_q3"]].tolist() == [1.25, 1.5, 1.75]
    counts = table[["replicates", "validated_replicates"]].to_numpy().tolist()
    assert counts == [[4, 4], [3, 2], [1, 0], [1, 0]]


def drawn_lines(axes: Axes) -> dict[str, list[float]]:
    return {str(line.get_label()): np.asarray(line.get_ydata()).tolist() for line in axes.lines}


@pytest.mark.parametrize("width", [3.5, 7.0])
def test_treatments_share_panels_and_one_legend(width: float) -> None:
    figure, table = draw_fitness(STUDY, width), compute_quartiles(STUDY)
    recorded, validated = figure.axes
    assert [axes.get_title() for axes in figure.axes] == ["best, recorded", "best, validated"]
    calm, storm = (table[table["treatment"] == name] for name in ("calm", "storm"))
    assert drawn_lines(recorded) == {
        "calm (n = 4)": calm["recorded_median"].tolist(),
        "storm (n = 1)": storm["recorded_median"].tolist(),
    }
    assert drawn_lines(validated) == {"calm (n = 4)": calm["validated_median"].tolist()}
    (band,) = (np.asarray(band.get_paths()[0].vertices) for band in validated.collections)
    assert (band[:, 1].min(), band[:, 1].max()) == (1.25, 4.5)
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["calm (n = 4)", "storm (n = 1)"]


def test_several_runs_of_one_treatment_have_all_lines_in_one_panel() -> None:
    (axes,) = draw_fitness(STUDY[STUDY["treatment"] == "calm"]).axes
    assert axes.get_title() == "calm (n = 4)"
    assert list(drawn_lines(axes)) == ["best, recorded", "best, validated", "mean of pool"]


def test_the_best_of_a_run_with_a_confirmation_is_a_confirmed_one() -> None:
    table = TABLE.assign(loss=[NAN, NAN, 0.5, 0.0, NAN, 1.0])
    assert select_bests(table)["fitness"].tolist() == [2.5, 4.0, 5.5]
    assert select_bests(TABLE)["fitness"].tolist() == BEST


def test_of_equals_the_first_is_the_best_as_in_the_run() -> None:
    table = TABLE.assign(fitness=1.0, id=range(6))
    assert select_bests(table)["id"].tolist() == [0, 3, 5]


def test_the_layout_of_what_is_saved_has_no_digits_left_to_chance() -> None:
    figure = Figure(figsize=(3.5, 3.0), layout="constrained")
    top, bottom = figure.subfigures(2, 1, squeeze=False, height_ratios=[1, 2.3]).ravel()
    inner = bottom.subfigures(1, 2, squeeze=False, width_ratios=[1, 1.7]).ravel()
    for part in (top, *inner):
        part.subplots().set_xlabel("a label")
    save(figure, io.BytesIO())
    parts = [part.bbox_relative.get_points() for part in (top, bottom, *inner)]
    axes = [axes.get_position(original=True).get_points() for axes in figure.axes]
    result = np.array([*parts, *axes])
    np.testing.assert_allclose(result, np.round(result, 6), rtol=0, atol=1e-12)
    assert len({tuple(artist.ravel()) for artist in result}) > 4


def test_files_bring_their_letters_along() -> None:
    """A PDF as TrueType fonts, which publishers accept, an SVG as outlines."""
    pdf, svg = saved(TABLE, "pdf"), saved(TABLE, "svg")
    assert b"/FontFile2" in pdf
    assert b"/Subtype /Type3" not in pdf
    assert b"<text" not in svg


def test_the_interval_of_the_champion_stands_beside_the_last_generation() -> None:
    (axes,) = draw_fitness(TABLE, champion=Interval(4.5, 4.0, 5.25)).axes
    (bar,) = (artist for artist in axes.collections if isinstance(artist, LineCollection))
    ((start, end),) = bar.get_segments()
    assert start[0] == end[0] > TABLE["generation"].max()
    assert (start[1], end[1]) == (4.0, 5.25)
