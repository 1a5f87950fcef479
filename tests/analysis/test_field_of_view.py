"""A field of view is the width that was asked for, wherever it is printed, drawn or exported."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from bundled_parts import configured, kinds
from comb import Comb
from helpers import finished_run
from lxml import etree
from robot_cases import rover
from sensor_runs import VIEWS, WIDE, read_widths

from evoros.analysis.command import evoros_analyze
from evoros.analysis.report.playback import encode_sensors
from evoros.analysis.tables.champions import read_champion_sensors
from evoros.analysis.tables.records import read_record
from evoros.config.compose import compose
from evoros.controller.briefing_text import describe_briefing
from evoros.controller.protocol import Briefing
from evoros.formats.urdf.sensors import read_sensors
from evoros.robot.seen import BEARINGS_DEG, find_seen
from evoros.sensor.infrared import Infrared
from evoros.sensor.lidar import Lidar
from evoros.sensor.multizone import Multizone
from evoros.sensor.protocol import Mount, find_field, sees
from evoros.sensor.sonar import Sonar
from evoros.terminal.console import DONE

CASES: tuple[tuple[str, type[Any], dict[str, float], float], ...] = (
    ("sonar", Sonar, {"fov_deg": 27}, 27),
    ("sonar", Sonar, {"fov_deg": 27, "rays_per_axis": 1}, 0),
    ("infrared", Infrared, {"fov_deg": 7.5}, 7.5),
    ("multizone", Multizone, {"fov_deg": 27, "zones": 1}, 27),
    ("multizone", Multizone, {"fov_deg": 45, "zones": 8, "rays_per_zone": 1}, 45),
    ("multizone", Multizone, {"fov_deg": 45, "zones": 1, "rays_per_zone": 1}, 0),
    ("lidar", Lidar, {"fov_deg": 90, "beams": 2}, 90),
    ("lidar", Lidar, {"fov_deg": 270, "beams": 90}, 270),
    ("lidar", Lidar, {"fov_deg": 360, "beams": 12}, 360),
    ("lidar", Lidar, {"fov_deg": 90, "beams": 1}, 0),
)
"""Types with their fields, and the width [deg] of the field of view; 0: a single ray."""


@pytest.mark.parametrize(("choice", "kind", "fields", "wide"), CASES)
def test_a_sensor_has_the_field_that_it_is_told(
    choice: str, kind: type[Any], fields: dict[str, float], wide: float
) -> None:
    sensor = kind(**fields)
    assert math.degrees(np.diff(find_field(sensor))[0]) == pytest.approx(wide, abs=1e-9)
    asked = [f"design.sensors.sonar.{name}={value}" for name, value in fields.items()]
    words = ["experiment=quickstart", f"sensor@design.sensors.sonar={choice}", *asked]
    mounted = compose(words).build().design.sensors["sonar"]
    assert isinstance(mounted, kind)
    assert find_field(mounted) == find_field(sensor)


@pytest.mark.parametrize(("choice", "kind", "fields", "wide"), CASES)
def test_gazebo_is_told_this_field(
    choice: str, kind: type[Any], fields: dict[str, float], wide: float
) -> None:
    """A lidar all around has no edge twice: its last beam is one space before the first."""
    text = f"<gazebo reference='link'>{kind(**fields).gazebo('eye')}</gazebo>"
    (read,), left_out = read_sensors(etree.fromstring(f"<robot>{text}</robot>"))
    assert not left_out
    space = wide / fields["beams"] if wide == 360 else 0.0
    assert read.settings.get("fov_deg", 0.0) == pytest.approx(wide - space)


@pytest.mark.parametrize(("choice", "kind", "fields", "wide"), CASES)
def test_it_sees_this_field(
    choice: str, kind: type[Any], fields: dict[str, float], wide: float
) -> None:
    """From the middle of the outline, to the degree."""
    sensor = kind(**fields, range_min_m=0.001)
    robot = rover()
    x = float((robot.outline[:, 0].min() + robot.outline[:, 0].max()) / 2)
    mounted = robot.with_sensors([Mount("eye", "base_link", x, 0, 0.1, 0, 0)], {"eye": sensor})
    (seen,) = find_seen(mounted, 0.5)
    assert seen.sum() == pytest.approx(max(wide, 1.0), abs=1.0)
    assert np.abs(BEARINGS_DEG[seen]).max() <= max(wide, 1.0) / 2


def test_the_cases_have_all_types_that_see() -> None:
    parts = [configured("sensor", choice) for choice in kinds("sensor")]
    assert {type(part) for part in parts if sees(part)} == {kind for _, kind, _, _ in CASES}
    assert not any(hasattr(part, "fov_deg") for part in parts if not sees(part))


@pytest.mark.parametrize("wide", [30.0, 200.0, 355.0])
def test_a_sensor_that_states_no_field_has_that_of_its_rays(wide: float) -> None:
    low, high = find_field(Comb(tuple(np.linspace(-wide / 2, wide / 2, 72).tolist())))
    whole = wide if wide < 300 else 360
    assert math.degrees(high - low) == pytest.approx(whole)


@pytest.mark.slow
def test_whatever_states_a_field_of_view_states_this_one(tmp_path: Path) -> None:
    """The panel and the report."""
    run = finished_run(tmp_path / "run", *VIEWS)
    record = read_record(run, "run")
    out = tmp_path / "out"
    assert evoros_analyze(["panel", str(run), "--output", str(out)]) == DONE
    panel = pd.read_csv(out / "panel.csv")
    assert panel.fov_deg.tolist() == [*WIDE.values()]
    drawn = encode_sensors(read_champion_sensors(record))
    assert [sensor["fov"] for sensor in drawn] == [round(math.radians(w), 4) for w in WIDE.values()]


@pytest.mark.parametrize(("choice", "kind", "fields", "wide"), CASES)
def test_a_program_is_told_this_field(
    choice: str, kind: type[Any], fields: dict[str, float], wide: float
) -> None:
    eye = Mount("eye", "base_link", 0, 0, 0.1, 0, 0)
    robot = rover().with_sensors([eye], {"eye": kind(**fields)})
    briefing = Briefing(robot, (0.0, 0.0, 0.0, 0.0), np.zeros((1, 2)), 1.0, 10.0, 0)
    assert list(read_widths(describe_briefing(briefing)["sensors"])) == pytest.approx([wide])
