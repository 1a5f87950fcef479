"""Sensors that every design has."""

from dataclasses import replace

import numpy as np
import pytest
from design_cases import FRONT, MIXED, ROBOT
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.design.design import Design
from evoros.design.space import FixedSensor, SensorDesign
from evoros.sensor.protocol import Mount
from evoros.sensor.sonar import Sonar

MAST = FixedSensor("own", "mast", z_m=0.1, yaw_deg=180)
SENSORS = {**MIXED.sensors, "own": Sonar(fov_deg=5)}
BOTH = replace(MIXED, sensors=SENSORS, fixed={"back": MAST})
SPACE = BOTH.bind(ROBOT)


@given(genome=arrays(np.float64, SPACE.size, elements=st.floats(0, 1)))
def test_every_design_has_them_beside_what_it_would_have_without(genome: Array) -> None:
    mounts = SPACE.decode(genome).mounts
    assert [m for m in mounts if m.sensor == "own"] == [Mount("own", "mast", 0, 0, 0.1, 180, 0)]
    placed = [m for m in mounts if m.sensor != "own"]
    assert tuple(placed) == MIXED.bind(ROBOT).decode(genome).mounts
    assert SPACE.to_row(genome) == MIXED.bind(ROBOT).to_row(genome)


def test_a_design_may_have_nothing_else() -> None:
    alone = SensorDesign(
        sensors={"own": Sonar()}, regions={}, number=0, mirrored=False, fixed={"back": MAST}
    )
    space = alone.bind(ROBOT)
    assert space.size == 0
    assert [mount.sensor for mount in space.decode(np.empty(0)).mounts] == ["own"]


def test_a_pose_is_the_origin_of_the_default_link_unless_it_is_given() -> None:
    assert FixedSensor("own").bind(ROBOT, "") == Mount("own", ROBOT.mount_link, 0, 0, 0, 0, 0)


def test_a_type_that_does_not_exist_is_an_error() -> None:
    with pytest.raises(InputError, match=r"fixed\.back\.sensor: must be near or far, not 'own'"):
        replace(MIXED, fixed={"back": MAST})


def test_a_link_that_does_not_exist_is_an_error() -> None:
    design = replace(BOTH, fixed={"back": replace(MAST, link="roof")})
    with pytest.raises(InputError, match=r"design\.fixed\.back\.link: .*not 'roof'.*mast"):
        design.bind(ROBOT)


def test_sensors_cannot_be_placed_if_all_types_are_fixed() -> None:
    with pytest.raises(InputError, match="must not be empty if sensors are placed"):
        SensorDesign({"own": Sonar()}, {"front": FRONT}, 1, False, fixed={"back": MAST})


def test_a_design_of_several_robots_is_joined_from_its_parts() -> None:
    parts = {name: SPACE.decode(np.full(SPACE.size, x)) for name, x in (("", 0.2), ("other", 0.7))}
    joined = Design.join(parts).parts
    assert {name: replace(part, agents={}) for name, part in joined.items()} == parts
