"""Figures of designs on the robot: the numbers behind them, and that they show these numbers."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from design_figure_cases import NAN, PAIRS, SETTING, TWO, bare, folder, product, sensor, table
from fixture_types import Capture, Log
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection, PolyCollection
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from evoros.analysis.command import evoros_analyze
from evoros.analysis.designs import cones
from evoros.analysis.drawing import paper
from evoros.analysis.drawing import robot as rover
from evoros.analysis.drawing.robot import Champions
from evoros.analysis.drawing.sheet import Sheet
from evoros.analysis.drawing.style import CATEGORIES
from evoros.analysis.figures import overlay, panel, regions
from evoros.analysis.tables.designs import adapt_types
from evoros.design.protocol import Area
from evoros.storage.figure_context import Beam, FigureContext, Part
from evoros.terminal.console import DONE, INPUT


def test_a_gene_widens_a_beam_and_no_single_ray() -> None:
    beams = {"sonar": Beam(30.0, 0.06, 1.0, 0.1), "laser": Beam(0.0, 0.06, 1.0, 0.1)}
    evolved = {f"design.sensors.{kind}.fov_deg": 50.0 for kind in beams}
    adapted = adapt_types(replace(SETTING, beams=beams), evolved)
    assert {kind: beam.fov_deg for kind, beam in adapted.beams.items()} == {
        "sonar": 50.0,
        "laser": 0.0,
    }


def areas(cover: pd.DataFrame) -> dict[int, float]:
    """Square metres by the number of champions that cover them."""
    area = (cover.y_high_m - cover.y_low_m) * cover.cell_m
    total = area.groupby(cover.iloc[:, -1]).sum()
    return dict(zip(total.index.tolist(), total.tolist(), strict=True))


def covers(*rows: dict[str, object], cut: float = 1.0) -> dict[int, float]:
    return areas(overlay.count_coverage(table(*rows), {"all runs": SETTING}, (cut,)))


def sector(opening_deg: float, radius_m: float = 1.0) -> float:
    return math.radians(opening_deg) / 2 * radius_m**2


# The counts of an overlay.


def test_a_cone_covers_the_area_of_its_sector() -> None:
    assert covers(sensor(0, 0, 20)) == pytest.approx({1: sector(30)}, rel=0.01)
    assert covers(sensor(0, 0, 20), cut=0.5) == pytest.approx({1: sector(30, 0.5)}, rel=0.01)


def test_two_champions_count_twice_where_their_cones_coincide() -> None:
    assert covers(sensor(0, 0, 0, "a"), sensor(0, 0, 15, "b")) == pytest.approx(
        {1: 2 * sector(15), 2: sector(15)}, rel=0.02
    )


def test_a_champion_counts_once_wherever_its_own_cones_coincide() -> None:
    both = covers(sensor(0, 0, 0), sensor(0, 0, 15, sensor=1, pair=1), bare("b"))
    assert both == pytest.approx({1: sector(45)}, rel=0.01)


def test_a_beam_of_one_ray_is_seen() -> None:
    one = covers(sensor(0.5 / overlay.CELLS, 0, 90, fov_deg=0.0))
    assert one == pytest.approx({1: 1.0 / overlay.CELLS}, rel=0.02)


@pytest.mark.slow
@settings(max_examples=15, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.floats(-0.2, 0.2), st.floats(-0.2, 0.2), st.floats(-180, 180), st.sampled_from("abc")
        ),
        min_size=1,
        max_size=5,
    )
)
def test_the_mirror_image_of_the_champions_covers_the_mirror_image(
    mounts: list[tuple[float, float, float, str]],
) -> None:
    part = table(*(sensor(x, y, yaw, run) for x, y, yaw, run in mounts))
    image = part.assign(y_m=-part.y_m, yaw_deg=-part.yaw_deg)
    one, other = (
        overlay.count_coverage(artist, {"all runs": SETTING}, (0.4,)) for artist in (part, image)
    )
    swapped = other.assign(y_low_m=-other.y_high_m, y_high_m=-other.y_low_m)
    order = ["x_m", "y_low_m"]
    pd.testing.assert_frame_equal(
        one.sort_values(order, ignore_index=True), swapped.sort_values(order, ignore_index=True)
    )


def test_cones_are_cut_at_the_robots_length_and_shown_whole() -> None:
    assert overlay.choose_cuts(table(sensor(0, 0, 0)), {"all runs": SETTING}) == (0.4, 1.0)
    assert overlay.choose_cuts(table(sensor(0, 0, 0)), {"all runs": SETTING}, 0.7) == (0.7, 1.0)
    assert overlay.choose_cuts(table(sensor(0, 0, 0)), {"all runs": SETTING}, 2.0) == (1.0,)
    assert overlay.choose_cuts(table(bare("a")), {"all runs": SETTING}) == ()


@pytest.mark.parametrize(
    ("short_m", "cuts"), [(0.2, (0.4, 6.0)), (0.8, (0.8, 6.0)), (2.0, (0.4, 2.0, 6.0))]
)
def test_short_cones_are_no_specks_beside_long_ones(
    short_m: float, cuts: tuple[float, ...]
) -> None:
    short, beam = sensor(0, 0, 0), sensor(0, 0, 0, sensor=1, pair=1)
    both = table({**short, "range_m": short_m}, {**beam, "range_m": 6.0})
    assert overlay.choose_cuts(both, {"all runs": SETTING}) == cuts


@pytest.mark.parametrize("count", [2, 4, 6])
def test_several_treatments_fit_on_a_page(count: int) -> None:
    rows = table(*(sensor(0.1, 0, 30 * i, str(i)) for i in range(count)))
    sensors = rows.assign(treatment=[f"treatment {i} with a long name" for i in range(count)])
    chosen = dict.fromkeys(sensors.treatment, SETTING)
    cover = overlay.count_coverage(sensors, chosen, overlay.choose_cuts(sensors, chosen))
    figure = overlay.draw_overlay(cover, Champions(sensors, chosen), 7.0)
    assert figure.get_figheight() < 10.0  # of US letter, with margins of half an inch


# What is drawn of them.


def drawn(*rows: dict[str, object], width: float = 3.5) -> tuple[pd.DataFrame, Figure]:
    sensors = table(*rows)
    chosen = dict.fromkeys(sensors.treatment, SETTING)
    cover = overlay.count_coverage(sensors, chosen, overlay.choose_cuts(sensors, chosen))
    return cover, overlay.draw_overlay(cover, Champions(sensors, chosen), width)


def test_the_shades_are_the_counts_of_the_table() -> None:
    cover, figure = drawn(sensor(0.1, 0, 10, "a"), sensor(0, 0.1, 15, "b"))
    for axes, cut in zip(figure.axes, (0.4, 1.0), strict=False):
        (image,) = axes.get_images()
        shown = image.get_array()
        assert isinstance(shown, np.ma.MaskedArray)
        counts = np.asarray(shown.filled(0))
        part = cover[cover.cut_m == cut]
        cells = {count: int((counts == count).sum()) for count in (1, 2)}
        assert {k: n * float(part.cell_m.iloc[0]) ** 2 for k, n in cells.items()} == pytest.approx(
            areas(part)
        )
        left, right, bottom, top = image.get_extent()
        across = left + (np.arange(counts.shape[1]) + 0.5) / counts.shape[1] * (right - left)
        along = bottom + (np.arange(counts.shape[0]) + 0.5) / counts.shape[0] * (top - bottom)
        span = part.iloc[len(part) // 2]
        row = counts[np.abs(along - span.x_m).argmin()]
        within = (across > span.y_low_m) & (across < span.y_high_m)
        assert set(row[within]) == {span.champions}


def test_every_sensor_is_a_dot_at_its_place_left_is_left_and_ahead_is_up() -> None:
    _, figure = drawn(sensor(0.1, 0.05, 10, "a"), sensor(-0.1, -0.02, 15, "b"))
    axes = figure.axes[0]
    (dots,) = (artist for artist in axes.collections if isinstance(artist, PathCollection))
    assert np.asarray(dots.get_offsets()).tolist() == [[0.05, 0.1], [-0.02, -0.1]]
    across, up = axes.transData.transform([[0.05, 0.1], [-0.02, -0.1]]).T
    assert across[0] < across[1]
    assert up[0] > up[1]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("y, left [m]", "x, forward [m]")
    assert axes.get_aspect() == 1.0


def test_treatments_stand_side_by_side_at_one_scale() -> None:
    rows = [sensor(0.1, 0, 10 * i, f"r{i}", treatment=f"t{i}") for i in range(3)]
    _, figure = drawn(*rows, width=7.0)
    near = [axes for axes in figure.axes if axes.get_title(loc="left").startswith("t")]
    assert [axes.get_title(loc="left").split("\n")[0] for axes in near] == [
        "t0 (1 champion)",
        "t1 (1 champion)",
        "t2 (1 champion)",
    ]
    assert len({(*axes.get_xlim(), *axes.get_ylim()) for axes in near}) == 1
    assert len({round(axes.get_position().y0, 9) for axes in near}) == 1


def test_of_single_champions_the_sensors_are_counted() -> None:
    cover, figure = drawn(sensor(0, 0, 0), sensor(0, 0, 15, sensor=1, pair=1))
    part = cover[cover.cut_m == 1.0]
    assert areas(part) == pytest.approx({1: 2 * sector(15), 2: sector(15)}, rel=0.02)
    assert figure.axes[-1].get_ylabel() == "sensors covering the point"


def test_a_champion_without_sensors_counts_and_covers_nothing() -> None:
    cover, figure = drawn(sensor(0, 0, 0, "a"), bare("b"))
    assert cover.champions.max() == 1
    assert figure.axes[0].get_title(loc="left").startswith("2 champions\n")
    cover, figure = drawn(bare("a"))
    assert cover.empty
    assert "no sensors" in figure.axes[0].get_title(loc="left")


def test_types_of_sensors_have_shapes_of_their_own() -> None:
    mixed = [sensor(0, 0, 0), sensor(0.1, 0, 0, sensor=1, pair=1, type="lidar", fov_deg=90.0)]
    for figure in (drawn(*mixed)[1], panels(*mixed)):
        (legend,) = figure.legends
        names = [artist.get_text() for artist in legend.get_texts()]
        assert names[-2:] == ["lidar", "sonar"]
    assert len(set(rover.assign_markers(table(*mixed)).values())) == 2


# A panel a champion.


def panels(*rows: dict[str, object], width: float = 7.0) -> Figure:
    sensors = panel.rank_pairs(table(*rows))
    figure: Figure = panel.draw_panels(sensors, dict.fromkeys(sensors.treatment, SETTING), width)
    return figure


def colours(axes: Axes) -> list[str]:
    """The colours of the cones, in the order of the sensors."""
    cones = [artist for artist in axes.collections if isinstance(artist, PolyCollection)]
    faces = np.asarray(cones[0].get_facecolor()) if cones else np.empty((0, 4))
    return [to_hex(tuple(face)) for face in faces.tolist()]


def test_twins_share_a_colour_that_tells_how_far_they_face_aside() -> None:
    assert panel.rank_pairs(table(*PAIRS))["rank"].tolist() == [2, 2, 0, 0, 1, 1]
    first, second, third = CATEGORIES[:3]
    assert colours(panels(*PAIRS).axes[0]) == [third, third, first, first, second, second]


def test_sensors_without_twins_have_a_colour_each() -> None:
    alone = [sensor(0, 0, yaw, sensor=i, pair=i) for i, yaw in enumerate((50, -60, 10, -5))]
    assert colours(panels(*alone).axes[0]) == [CATEGORIES[i] for i in (2, 3, 1, 0)]


def test_the_cones_of_a_panel_are_those_of_the_table_and_its_title_the_fitness() -> None:
    axes = panels(sensor(0.1, 0.05, 30)).axes[0]
    cone, *_ = (artist for artist in axes.collections if isinstance(artist, PolyCollection))
    (path,) = cone.get_paths()
    tip, *arc = np.asarray(path.vertices)[:-1].tolist()
    assert tip == [0.05, 0.1]
    reach = [math.hypot(x - 0.1, y - 0.05) for y, x in arc]
    angle = [math.degrees(math.atan2(y - 0.05, x - 0.1)) for y, x in arc]
    assert reach == pytest.approx([0.2] * len(arc))  # 0.6 of 0.4 m, to one digit
    assert (min(angle), max(angle)) == pytest.approx((15.0, 45.0))
    assert axes.get_title() == "0: 18.0 (17.0)"


def test_the_interval_of_a_champion_is_in_its_titles() -> None:
    certified = {"fitness_low": 16.25, "fitness_high": 17.75}
    assert (
        panels(sensor(0, 0, 0, "a", **certified)).axes[0].get_title()
        == "0: 18.0 (17.0)\n[16.2, 17.8]"
    )
    _, figure = drawn(sensor(0, 0, 0, "a", **certified))
    head, fitness, _ = figure.axes[0].get_title(loc="left").split("\n")
    assert (head, fitness) == ("1 champion", "validated 16.96 [16.25, 17.75]")
    several = drawn(sensor(0, 0, 0, "a", **certified), sensor(0, 0, 0, "b", **certified))[1]
    assert "validated" not in several.axes[0].get_title(loc="left")


def test_an_unvalidated_champion_without_sensors_has_its_panel() -> None:
    figure = panels(sensor(0, 0, 0, "a"), bare("b", seed=4, validated_fitness=NAN))
    assert [colours(axes) for axes in figure.axes] == [[CATEGORIES[0]], []]
    assert figure.axes[1].get_title() == "4: 18.0 (-)"
    assert len(panels(bare("b")).axes) == 1


@pytest.mark.parametrize(("treatments", "replicates"), [(1, 1), (1, 10), (2, 7)])
@pytest.mark.parametrize("width", [3.5, 7.0])
def test_a_panel_a_replicate_on_a_page(treatments: int, replicates: int, width: float) -> None:
    rows = [
        sensor(0, 0, 20, f"{t}/{i}", seed=i, treatment=f"t{t}")
        for t in range(treatments)
        for i in range(replicates)
    ]
    figure = panels(*rows, width=width)
    assert [axes.get_title()[0] for axes in figure.axes] == [str(r["seed"]) for r in rows]
    assert figure.get_figwidth() == width
    assert figure.get_figheight() <= panel.PAGE_HEIGHT_IN or width < 7.0
    tops = [round(axes.get_position().y1, 6) for axes in figure.axes]
    firsts = [tops[t * replicates] for t in range(treatments)]
    assert firsts == sorted(set(firsts), reverse=True)  # each treatment begins a row


@settings(max_examples=12, deadline=None)
@given(
    st.integers(1, 4),
    st.lists(st.tuples(st.floats(0.2, 2.0), st.floats(0.1, 1.0)), min_size=1, max_size=4),
)
def test_panels_of_a_sheet_have_their_shape_and_lie_apart_on_the_page(
    columns: int, rows: list[tuple[float, float]]
) -> None:
    page = Sheet(7.0, columns, [ratio for ratio, _ in rows], [head for _, head in rows])
    figure = page.make_figure()
    for row, (ratio, _) in enumerate(rows):
        for column in range(columns):
            box = page.add_panel(figure, row, column).get_position()
            wide, tall = box.width * 7.0, box.height * figure.get_figheight()
            assert tall / wide == pytest.approx(ratio)
    boxes = [axes.get_position() for axes in figure.axes]
    assert all(b.x0 > -1e-9 and b.x1 < 1 and b.y0 > -1e-9 and b.y1 < 1 for b in boxes)
    for i, one in enumerate(boxes):
        for two in boxes[i + 1 :]:
            beside = one.x1 < two.x0 or two.x1 < one.x0
            assert beside or one.y0 > two.y1 or two.y0 > one.y1


def test_labels_keep_apart() -> None:
    labels = paper.spread([0.0, 0.01, 0.02, 0.5], 0.05)
    assert np.diff(labels).min() >= 0.05 - 1e-12
    assert paper.spread([0.0, 1.0], 0.5) == [0.0, 1.0]


# Where sensors may be.


def test_the_table_of_regions_has_each_region_and_its_mirror_image() -> None:
    result: Any = regions.list_regions({"all runs": SETTING}).set_index(["region", "twin"])
    left, image = result.loc["left", False], result.loc["left", True]
    assert (left.x1_m, left.y1_m, left.yaw_low_deg, left.yaw_high_deg) == (0.2, 0.05, 40.0, 90.0)
    assert (image.x1_m, image.y1_m) == (0.2, -0.05)
    assert (image.yaw_low_deg, image.yaw_high_deg) == (-90.0, -40.0)
    assert len(result) == 4
    alone = FigureContext(**{**vars(SETTING), "mirrored": False})
    assert len(regions.list_regions({"all runs": alone})) == 2


def test_regions_are_drawn_with_fans_of_their_headings_and_names() -> None:
    (axes,) = regions.draw_regions({"all runs": SETTING}).axes
    texts = {text.get_text() for text in axes.texts}
    assert texts == {"left\n40 to 90°", "front\n\N{MINUS SIGN}30 to 30°"}
    shapes = [patch.get_xy()[:-1] for patch in axes.patches if isinstance(patch, Polygon)]
    area = [(0.05, 0.0), (0.05, 0.2), (0.1, 0.2), (0.1, 0.0)]
    assert any(shape.tolist() == [list(point) for point in area] for shape in shapes)
    fans = [shape for shape in shapes if np.allclose(shape[0], (0.075, 0.1))]
    (fan,) = fans
    angles = np.degrees(np.arctan2(fan[1:, 0] - 0.075, fan[1:, 1] - 0.1))
    assert (angles.min(), angles.max()) == pytest.approx((40.0, 90.0))


def test_a_side_of_the_outline_is_a_line_with_fans_along_it() -> None:
    corners = ((0.2, -0.1), (0.2, 0.1), (-0.2, 0.1))
    facing = ((-10.0, 10.0), (80.0, 100.0))
    side = Area("base_link", corners, (-10.0, 100.0), (0.1, 0.1), (0.0, 0.0), facing)
    context = replace(SETTING, regions={"side": side}, mirrored=True)
    (axes,) = regions.draw_regions({"all runs": context}).axes
    lines = [np.column_stack(line.get_data()) for line in axes.lines]
    assert any(np.array_equal(line, np.array(corners)[:, ::-1]) for line in lines)
    fans = [np.asarray(patch.get_path().vertices)[0] for patch in axes.patches]
    for middle in ((0.0, 0.2), (0.1, 0.0), (-0.1, 0.0)):  # y, x; of the second its twin too
        assert any(np.allclose(fan, middle) for fan in fans)
    table = regions.list_regions({"all runs": context})
    assert table.twin.tolist() == [False, True]
    assert table.yaw_low_deg.tolist() == [-10.0, -100.0]
    assert table.y2_m.tolist() == [0.1, -0.1]


def test_where_only_twins_are_is_dashed() -> None:
    (axes,) = regions.draw_regions({"all runs": SETTING}).axes
    dashed = [
        patch.get_xy()
        for patch in axes.patches
        if isinstance(patch, Polygon) and patch.get_linestyle() == "--"
    ]
    assert dashed
    assert all(shape[:, 0].max() < 0 for shape in dashed)  # right of the middle: left's twins
    assert "mirrored" in axes.get_title(loc="left")
    (axes,) = regions.draw_regions(
        {"all runs": FigureContext(**{**vars(SETTING), "mirrored": False})}
    ).axes
    assert not [patch for patch in axes.patches if patch.get_linestyle() == "--"]
    assert axes.get_title(loc="left") == ""


# The robot.


def test_round_parts_are_round_and_all_are_where_they_are() -> None:
    base, wheel = (cones.outline_part(part) for part in SETTING.parts)
    assert sorted(map(tuple, base.tolist())) == [(-0.2, -0.1), (-0.2, 0.1), (0.2, -0.1), (0.2, 0.1)]
    assert np.hypot(*(wheel - (0.1, 0.12)).T) == pytest.approx(np.full(len(wheel), 0.05))
    swept = cones.outline_part(Part("rod", ((0.0, 0.0), (1.0, 0.0)), 0.1, 0.1, False))
    assert (swept.min(axis=0).tolist(), swept.max(axis=0).tolist()) == (
        pytest.approx([-0.1, -0.1]),
        pytest.approx([1.1, 0.1]),
    )


# All of them, as the command makes them.


def test_a_robot_without_sensors_is_drawn(tmp_path: Path) -> None:
    bald = folder(tmp_path / "run")
    out = str(tmp_path / "out")
    for name in ("overlay", "panel", "regions"):
        assert evoros_analyze([name, str(bald), "--output", out, "--format", "svg"]) == DONE
    sensors = pd.read_csv(tmp_path / "out" / "panel.csv")
    assert sensors.fitness.tolist() == [17.0]
    assert sensors.x_m.isna().all()


def test_an_unfinished_run_is_left_out(tmp_path: Path, caplog: Log) -> None:
    folder(tmp_path / "none" / "seed-0", mounts=TWO)
    half = folder(tmp_path / "none" / "seed-1", seed=1)
    (half / "champion" / "design.csv").unlink()
    made = product("panel", tmp_path / "none")
    assert made.figure is not None
    assert len(made.figure.axes) == 1
    assert [r.message for r in caplog.records if "resume" in r.message]


@pytest.mark.parametrize("cut", ["0", "-1", "nan", "inf", "far"])
def test_a_cut_that_is_no_length_is_one_line(cut: str, tmp_path: Path, capsys: Capture) -> None:
    run = folder(tmp_path / "run", mounts=TWO)
    assert evoros_analyze(["overlay", str(run), f"--cut={cut}"]) == INPUT
    (line,) = capsys.readouterr().err.splitlines()
    assert "--cut" in line


def test_settings_that_are_drawn_alike_share_a_panel(tmp_path: Path) -> None:
    folder(tmp_path / "none" / "run", FigureContext(**{**vars(SETTING), "rings": ()}))
    folder(tmp_path / "spatial" / "run")
    folder(tmp_path / "free" / "run", FigureContext(**{**vars(SETTING), "mirrored": False}))
    made = product("regions", tmp_path)
    assert made.figure is not None
    assert len(made.figure.axes) == 2
    assert made.table is not None
    assert sorted(set(made.table.treatment)) == ["free", "none and 1 more"]


def test_a_picture_is_readable_in_grey() -> None:
    cmap, norm = overlay._shades(10)
    grey = [np.dot(cmap(norm(count))[:3], (0.299, 0.587, 0.114)) for count in range(1, 11)]
    assert np.diff(grey).max() < -0.02  # each darker than the one before
