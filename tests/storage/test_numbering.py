"""One number for each sensor, whatever file of a run speaks of it."""

import math

import pytest
from helpers import tiny
from lxml import etree

from evoros.storage.reading import Run, load_run
from evoros.terminal.console import DONE

MIXED = [
    "+sensor@design.sensors.other=sonar",
    "+filter@design.sensors.other.filters.dumb=silence",
    "design.number=6",
    "design.mirrored=false",
    "failure.count=2",
]


@pytest.fixture(scope="module", params=range(3))
def run(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Run:
    folder = tmp_path_factory.mktemp("run") / "run"
    assert tiny(folder, *MIXED, f"seed={request.param}") == DONE
    return load_run(folder)


def test_each_sensor_of_the_table_is_a_link_of_the_robot_at_its_pose(run: Run) -> None:
    robot = etree.parse(run.path / "champion" / "robot.urdf").getroot()
    joints = {joint.get("name"): joint for joint in robot.findall("joint")}
    assert set(run.champion["type"]) == {"sonar", "other"}  # else nothing is told apart
    for row in run.champion.itertuples():
        joint = joints[f"{row.type}_{row.sensor}_joint"]
        parent, child, origin = (joint.find(tag) for tag in ("parent", "child", "origin"))
        assert parent is not None and child is not None and origin is not None  # noqa: PT018
        assert (parent.get("link"), child.get("link")) == (row.link, f"{row.type}_{row.sensor}")
        xyz = [float(word) for word in str(origin.get("xyz")).split()]
        rpy = [math.degrees(float(word)) for word in str(origin.get("rpy")).split()]
        assert xyz == [row.x_m, row.y_m, row.z_m]
        assert rpy == pytest.approx([0, -float(str(row.pitch_deg)), float(str(row.yaw_deg))])


def test_each_trajectory_and_mission_numbers_the_sensors_alike(run: Run) -> None:
    mine = run.missions[run.missions["design"] == run.champion["design"][0]]
    faults = 0
    for mission in mine[mine["purpose"] == "selection"].itertuples():
        ranges = run.trajectory(str(mission.world)).filter(regex="^range_")
        failed = [int(i) for i in str(mission.failed_sensors).split(";") if i.isdigit()]
        for kind, sensor in zip(run.champion["type"], run.champion["sensor"], strict=True):
            silent = ranges[f"range_{sensor}_m"].isna()
            assert silent.all() == (kind == "other")
            if kind == "sonar":
                assert silent.iloc[-1] == (sensor in failed)
                faults += sensor in failed
    assert faults
