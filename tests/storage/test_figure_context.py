"""What a folder says of its experiment is what the experiment is."""

import io
import json
import re
from collections.abc import Callable, Hashable, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from documents import text
from hypothesis import given, settings
from hypothesis import strategies as st

from evoros.analysis.tables.designs import list_mounts, place_sensors
from evoros.base.errors import InputError
from evoros.config.compose import compose
from evoros.design.design import Design
from evoros.evolution.experiment import Experiment
from evoros.sensor.protocol import Mount
from evoros.storage.champion_files import design_table
from evoros.storage.figure_context import FigureContext, Ring, describe_experiment


@cache
def evolving() -> Experiment:
    return compose(
        [
            "simulator=planar",
            "executor=serial",
            "+sensor@design.sensors.second=sonar",
            "design.number=[1,3]",
            "+design.regions.front.z_m=[0.1,0.2]",
            "+design.regions.left.pitch_deg=5.0",
        ]
    ).build()


@cache
def around() -> Experiment:
    return compose(
        [
            "simulator=planar",
            "executor=serial",
            "robot=two_wheeler",
            "robot.mount=null",
            "design=around",
            "design.mirrored=true",
            "+design.regions.front.height_m=0.12",
            "+design.regions.rear.pitch_deg=5",
        ]
    ).build()


@cache
def described(build: Callable[[], Experiment]) -> FigureContext:
    return describe_experiment(build())


@pytest.fixture(scope="module")
def experiment() -> Experiment:
    return compose(["simulator=planar", "failure=combined", "executor=serial"]).build()


@pytest.fixture(scope="module")
def setting(experiment: Experiment) -> FigureContext:
    return describe_experiment(experiment)


@pytest.mark.slow
def test_what_is_written_is_read(setting: FigureContext, tmp_path: Path) -> None:
    for context in (setting, describe_experiment(around())):
        (tmp_path / "setting.json").write_text(context.text)
        assert FigureContext.read(tmp_path) == context


def test_it_says_what_the_paper_and_the_configuration_say(setting: FigureContext) -> None:
    assert setting.beams["sonar"].fov_deg == pytest.approx(30.0, abs=1e-9)
    assert setting.beams["sonar"].range_max_m == 4.5
    assert setting.rings == (Ring(0.03, 1.0), Ring(0.06, 2 / 3), Ring(0.09, 1 / 3))
    assert setting.modes == ("avoiding", "navigating")
    assert setting.regions["left"].corners == ((0.0, 0.1), (0.2, 0.1), (0.2, 0.15), (0.0, 0.15))
    assert setting.regions["left"].yaw_deg == (40, 90)
    assert list(setting.courses) == ["boxes", "maze", "blocks"]


def test_the_parts_cover_what_the_robot_covers(
    experiment: Experiment, setting: FigureContext
) -> None:
    """Of the rover, 0.465 m by 0.325 m, with four wheels of 0.127 m by 0.056 m (case study)."""
    corners = np.array([point for part in setting.parts for point in part.vertices])
    np.testing.assert_allclose(corners.min(axis=0), (-0.215, -0.1625), atol=1e-12)
    np.testing.assert_allclose(corners.max(axis=0), (0.25, 0.1625), atol=1e-12)
    wheels = [np.array(part.vertices) for part in setting.parts if part.wheel]
    assert len(wheels) == 4
    for wheel in wheels:
        np.testing.assert_allclose(np.ptp(wheel, axis=0), (0.127, 0.056), atol=1e-12)


def test_a_robot_that_shows_a_mesh_is_drawn_by_what_can_touch(
    experiment: Experiment, tmp_path: Path
) -> None:
    urdf = experiment.robot.base_urdf.text
    link = urdf.index("<visual>")
    mesh = '<visual><geometry><mesh filename="a.dae"/></geometry></visual>'
    (tmp_path / "a.dae").touch()
    (tmp_path / "mesh.urdf").write_text(f"{urdf[:link]}{mesh}{urdf[link:]}")
    shown = [f"robot.description={tmp_path / 'mesh.urdf'}", "robot.arguments={}"]
    parts = describe_experiment(compose(["executor=serial", *shown]).build()).parts
    corners = [part.vertices[2] for part in parts if part.link == "base_link"]
    np.testing.assert_allclose(corners, [(0.25, 0.1625), (-0.01, 0.1)])  # box and roll cage


@pytest.mark.parametrize(
    ("change", "rule"),
    [
        (lambda raw: raw.pop("parts"), "damaged or edited"),
        (lambda raw: raw["parts"][0]["vertices"].append([1.0]), "must be 2 numbers"),
        (lambda raw: raw["courses"]["maze"].update(time_limit_s=-1), "time_limit_s"),
        (lambda raw: raw.update(unknown=1), "damaged or edited"),
    ],
)
def test_a_damaged_one_is_said_in_one_line(
    change: object, rule: str, setting: FigureContext, tmp_path: Path
) -> None:
    raw = json.loads(setting.text)
    change(raw)  # type: ignore[operator]
    (tmp_path / "setting.json").write_text(json.dumps(raw))
    with pytest.raises(InputError, match=rule) as error:
        FigureContext.read(tmp_path)
    assert "\n" not in str(error.value)
    assert str(tmp_path / "setting.json") in str(error.value)


@settings(max_examples=40)
@given(
    poses=st.lists(
        st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(-360, 360)), min_size=1, max_size=4
    ),
    yaw=st.floats(-3, 3),
)
def test_sensors_are_where_the_robot_has_them(
    poses: list[tuple[float, float, float]], yaw: float
) -> None:
    place = (0.1, -0.2, 0.3, yaw)
    robot = replace(evolving().robot, sensor_links={"mast": place})
    mounts = [Mount("sonar", "mast", x, y, 0.05, turn, 12.5) for x, y, turn in poses]
    with_sensors = robot.with_sensors(mounts, evolving().design.sensors)
    table = pd.read_csv(io.StringIO(design_table({1: Design(tuple(mounts))})))
    placed = place_sensors(table, replace(described(evolving), places={"mast": place}))
    expected = with_sensors.sensor_poses
    np.testing.assert_allclose(placed[["x_m", "y_m", "z_m"]], expected[:, :3], atol=1e-12)
    turned = np.radians(placed.yaw_deg) - expected[:, 3]
    np.testing.assert_allclose(np.cos(turned), 1.0, atol=1e-12)
    assert placed.yaw_deg.between(-180, 180).all()


@pytest.mark.parametrize("build", [evolving, around], ids=["boxes", "sides"])
@settings(max_examples=40)
@given(st.data())
def test_a_candidate_has_the_mounts_of_its_design(
    build: Callable[[], Experiment], data: st.DataObject
) -> None:
    experiment = build()
    space = experiment.space
    genome = np.array([data.draw(st.floats(0, 1)) for _ in range(space.size)])
    design = space.decode(genome)
    row = pd.DataFrame([{"id": 7, **space.to_row(genome)}])
    record = type("Record", (), {"context": described(build)})()
    mounts = list_mounts(row, record)
    assert [_mount(mount) for mount in mounts.to_dict("records")] == list(design.mounts)
    assert list(mounts.sensor) == list(range(len(design.mounts)))


def _mount(row: Mapping[Hashable, object]) -> Mount:
    names = ("link", "x_m", "y_m", "z_m", "yaw_deg", "pitch_deg")
    return Mount(str(row["type"]), *(row[name] for name in names))  # type: ignore[arg-type]


def test_a_design_without_sensors_has_no_rows(setting: FigureContext) -> None:
    assert place_sensors(pd.read_csv(io.StringIO(design_table({1: Design(())}))), setting).empty


def test_its_fields_are_documented_in_order(setting: FigureContext) -> None:
    (section,) = re.findall(r"^## setting\.json\n(.*?)^## ", text("run_folder"), re.M | re.S)
    assert re.findall(r"`(\w+)`", section) == list(json.loads(setting.text))
