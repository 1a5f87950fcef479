"""The figure of damage has the distances and probabilities of the failure that missions meet."""

import math
from pathlib import Path

import numpy as np
import pytest
from design_figure_cases import PAIRS, RINGS, SETTING, TWO, folder, product, sensor, table
from fixture_types import Capture
from matplotlib.patches import Circle

from evoros.analysis.command import evoros_analyze
from evoros.failure.spatial import SpatialFailure
from evoros.filter.protocol import Channels
from evoros.plugins.evo_ros_2018 import failure
from evoros.storage.figure_context import FigureContext
from evoros.terminal.console import DONE, INPUT


def row_of(x: float, index: int, z: float = 0.1) -> dict[str, object]:
    return sensor(x, 0.0, 0.0, sensor=index, pair=index, z_m=z)


def test_distances_and_probabilities_of_known_mounts() -> None:
    sensors = table(row_of(0.0, 0), row_of(0.025, 1), row_of(0.06, 2), row_of(0.0, 3, z=0.18))
    damage = failure.list_damage(sensors, RINGS[::-1])  # in whatever order
    result = {(r.centre, r.sensor): (r.distance_m, r.probability) for r in damage.itertuples()}
    expected = {
        (0, 0): (0.0, 1.0),
        (0, 1): (0.025, 1.0),
        (0, 2): (0.06, 2 / 3),  # on the ring is within it
        (0, 3): (0.08, 1 / 3),  # above it
        (1, 2): (0.035, 2 / 3),
        (1, 3): (math.hypot(0.025, 0.08), 1 / 3),
        (2, 3): (0.1, 0.0),
    }
    for (one, two), numbers in expected.items():
        assert result[one, two] == pytest.approx(numbers)
        assert result[two, one] == pytest.approx(numbers)
    assert len(result) == 16
    beyond = damage[(damage.centre == 2) & (damage.sensor == 3)]
    assert beyond.radius_m.isna().all()


def test_the_probabilities_are_those_of_the_failure_that_missions_meet() -> None:
    rng = np.random.default_rng(5)
    places = np.column_stack([rng.uniform(0, 0.15, (5, 2)), np.full(5, 0.1)])
    rows = [sensor(x, y, 0, sensor=i, pair=i, z_m=z) for i, (x, y, z) in enumerate(places.tolist())]
    mean = failure.list_damage(table(*rows), RINGS).groupby("sensor").probability.mean()
    channels = Channels(np.zeros(5), np.ones(5), places, 0.1)
    model, draws = SpatialFailure(), 4000
    hits = np.mean([np.isfinite(model.draw(channels, rng)[0].onset) for _ in range(draws)], axis=0)
    assert hits == pytest.approx(mean.to_numpy(), abs=4 * 0.5 / math.sqrt(draws))


def test_the_rings_surround_the_sensor_that_is_hit_and_the_labels_say_the_table() -> None:
    sensors = table(row_of(0.0, 0), row_of(0.05, 1), row_of(0.12, 2))
    damage = failure.list_damage(sensors, RINGS)
    figure = failure.draw_failure(damage, SETTING)
    for centre, axes in enumerate(figure.axes):
        circles = [patch for patch in axes.patches if isinstance(patch, Circle)]
        place = (0.0, (0.0, 0.05, 0.12)[centre])
        assert {tuple(np.asarray(circle.get_center())) for circle in circles} == {place}
        assert sorted(circle.get_radius() for circle in circles) == [0.03, 0.06, 0.09]
        part = damage[damage.centre == centre]
        said = {f"{r.sensor}: {r.probability:.2f}" for r in part.itertuples()}
        assert {text.get_text().strip() for text in axes.texts} == said
        assert f"{part.probability.sum():.1f} of 3 fail" in axes.get_title(loc="left")
    (legend,) = figure.legends
    assert [artist.get_text() for artist in legend.get_texts()] == [
        "within 3 cm: 1.00",
        "within 6 cm: 0.67",
        "within 9 cm: 0.33",
    ]


def test_of_twins_the_left_one_is_hit_and_the_other_is_named() -> None:
    figure = failure.draw_failure(failure.list_damage(table(*PAIRS[:4]), RINGS), SETTING)
    titles = [axes.get_title(loc="left").split("\n")[0] for axes in figure.axes]
    assert titles == ["sensor 0 hit (mirrored: 1)", "sensor 2 hit (mirrored: 3)"]


def test_the_failure_of_the_best_run_that_has_it_or_of_the_one_that_is_named(
    tmp_path: Path, capsys: Capture
) -> None:
    whole = FigureContext(**{**vars(SETTING), "rings": ()})
    folder(tmp_path / "none" / "seed-9", whole, seed=9, mounts=TWO)
    for seed in (0, 1):
        folder(tmp_path / "spatial" / f"seed-{seed}", seed=seed, mounts=TWO)
    every = [tmp_path / "none", tmp_path / "spatial"]
    made = product("failure", *every)
    assert "seed-1" in made.messages[0]  # validated alike: the one with more recorded
    assert made.table is not None
    assert len(made.table) == 4
    assert made.messages[0].endswith("the other 1 have no spatial failure")
    assert "seed-0" in product("failure", *every, run="seed-0").messages[0]
    out = str(tmp_path / "out")
    assert evoros_analyze(["failure", str(every[0]), "--output", out]) == INPUT
    assert "add a run with failure=spatial" in capsys.readouterr().err
    assert not Path(out).exists()


def test_without_sensors_nothing_can_be_damaged(tmp_path: Path, capsys: Capture) -> None:
    bald = folder(tmp_path / "run")
    assert evoros_analyze(["failure", str(bald), "--output", str(tmp_path / "out")]) == INPUT
    assert "choose another run with --run" in capsys.readouterr().err


def test_the_command_writes_the_same_bytes_twice(tmp_path: Path) -> None:
    run = folder(tmp_path / "run", mounts=TWO)
    files = []
    for out in (tmp_path / "one", tmp_path / "two"):
        assert evoros_analyze(["failure", str(run), "--output", str(out)]) == DONE
        files.append({file.name: file.read_bytes() for file in out.iterdir()})
    assert files[0] == files[1]
    assert set(files[0]) >= {"failure.pdf", "failure.csv"}
