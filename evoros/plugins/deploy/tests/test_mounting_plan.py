"""The drawing of a mounting plan: its numbers, its scale, and texts that do not overlap."""

import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.text import Text
from robot_cases import rover

from evoros.analysis.drawing.mounting import draw_mounting
from evoros.analysis.drawing.paper import choose_scale, separate, spread
from evoros.analysis.tables.records import Record
from evoros.plugins.deploy.champion import read_champion
from evoros.plugins.deploy.subcommand import plan_mounting
from evoros.plugins.deploy.tests.deploy_cases import champion_of
from evoros.sensor.protocol import Mount


def test_the_drawing_has_every_number_once_a_view(record: Record) -> None:
    plan = plan_mounting(read_champion(record))
    figure = draw_mounting(plan)
    (axes,) = figure.axes
    texts = [text.get_text().replace("\N{MINUS SIGN}", "-") for text in axes.texts]
    for sensor in plan.sensors:
        for value in sensor.place_mm:
            assert texts.count(f"{value:.1f}") >= 1  # in the table
            assert f"{round(value, 1) + 0.0:g}" in texts  # at a line
        assert (
            f"{abs(sensor.yaw_deg):.1f}\N{DEGREE SIGN} {'L' if sensor.yaw_deg > 0 else 'R'}"
            in texts
        )
    width, height = (25.4 * inches for inches in figure.get_size_inches())
    assert axes.get_xlim() == pytest.approx((0.0, width))  # to scale
    assert height < 297.0  # of A4
    assert any("150 mm ahead of the rear axle" in text for text in texts)


def test_the_drawing_is_to_scale(record: Record) -> None:
    plan = plan_mounting(read_champion(record))
    (axes,) = draw_mounting(plan).axes
    (note,) = (text.get_text() for text in axes.texts if "scale 1:" in text.get_text())
    scale = float(note.split(",")[0].removeprefix("scale 1:"))
    dots = np.array(
        [np.asarray(line.get_xydata())[0] for line in axes.lines if line.get_marker() == "."]
    )
    count = len(plan.sensors)
    places = np.array([sensor.place_mm for sensor in plan.sensors])
    for shown, plane in ((dots[:count], (0, 1)), (dots[count:], (0, 2))):
        np.testing.assert_allclose(
            np.diff(shown, axis=0) * scale, np.diff(places[:, plane], axis=0), atol=1e-6
        )


def test_no_text_covers_another(record: Record, tmp_path: Path) -> None:
    """Twelve sensors around the robot; discs of alike sensors touch, other texts do not meet."""
    angles = np.linspace(-180.0, 180.0, 12, endpoint=False)
    mounts = [
        Mount(
            "sonar", "base_link", 0.2 * math.cos(a), 0.15 * math.sin(a), 0.17, math.degrees(a), 5.0
        )
        for a in np.radians(angles)
    ]
    figure = draw_mounting(plan_mounting(champion_of(record, rover(), mounts, tmp_path)))
    figure.draw_without_rendering()
    texts = [text for text in figure.axes[0].texts if text.get_text()]
    boxes = [Text.get_window_extent(text) for text in texts]
    for i, box in enumerate(boxes):
        for j in range(i):
            meet = (
                box.x0 < boxes[j].x1
                and boxes[j].x0 < box.x1
                and box.y0 < boxes[j].y1
                and boxes[j].y0 < box.y1
            )
            assert not meet, (texts[i].get_text(), texts[j].get_text())


@given(st.lists(st.floats(-100.0, 100.0), max_size=20), st.floats(0.1, 20.0))
def test_spread_labels_keep_their_order_and_distance(places: list[float], minimum: float) -> None:
    moved = spread(sorted(places), minimum)
    assert len(moved) == len(places)
    assert all(b - a >= minimum - 1e-6 for a, b in pairwise(moved))
    if all(b - a >= minimum for a, b in pairwise(sorted(places))):
        assert moved == sorted(places)


@given(st.lists(st.tuples(st.floats(0.0, 100.0), st.floats(0.0, 100.0)), min_size=1, max_size=8))
def test_separated_boxes_do_not_overlap(centres: list[tuple[float, float]]) -> None:
    moved = separate(np.array(centres), (15.0, 4.0))
    for i in range(len(moved)):
        for j in range(i):
            assert np.max(np.abs(moved[i] - moved[j]) - (15.0, 4.0)) > -0.2


@given(st.floats(1e-3, 1e6), st.floats(10.0, 500.0))
def test_the_scale_fits_and_the_next_would_not_be_needed(length: float, room: float) -> None:
    scale = choose_scale(length, room)
    assert length / scale <= room * (1 + 1e-6)
    assert scale <= 0.01 or length / scale > room / 1.6
