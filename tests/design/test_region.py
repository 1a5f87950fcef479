"""Descriptions of designs and regions that are refused."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from design_cases import AVOID, FRONT, ROBOT

from evoros.base.errors import InputError
from evoros.design.genes import Gene
from evoros.design.region import Region
from evoros.design.space import SensorDesign
from evoros.sensor.sonar import Sonar
from evoros.testing import RegionSuite


class TestRegion(RegionSuite):
    part = Region([0.1, 0.2], [-0.1, 0.1], [-30, 30], z_m=[0.1, 0.18], pitch_deg=[0, 15])
    bad_values = (
        {"x_m": [0.2, 0.1]}, {"x_m": math.nan}, {"y_m": "left"}, {"yaw_deg": [0, 361]},
        {"yaw_deg": None}, {"pitch_deg": 91}, {"z_m": [1]}, {"link": " "}, {"overhang_m": -0.1},
    )  # fmt: skip


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Gene("optimizer.generations", 1, 2), r"Gene\.key"),
        (lambda: Gene("robot.height_m", 1, 2), r"Gene\.key"),
        (lambda: Gene("controller..x", 1, 2), r"Gene\.key"),
        (lambda: Gene(AVOID.key, 2, 1), r"Gene\.high"),
        (lambda: Gene(AVOID.key, 0.5, 2, whole=True), r"Gene\.whole"),
        (lambda: SensorDesign({}, {"front": FRONT}, 1, True), r"SensorDesign\.sensors"),
        (lambda: SensorDesign({"s": Sonar()}, {}, [0, 1], True), r"SensorDesign\.regions"),
        (lambda: SensorDesign({"s": Sonar()}, {"f": FRONT}, -1, True), r"SensorDesign\.number"),
        (lambda: SensorDesign({"s": Sonar()}, {"f": FRONT}, [2, 1], True), r"\.number"),
        (lambda: SensorDesign({"s": Sonar()}, {"": FRONT}, 1, True), r"SensorDesign\.regions"),
        (lambda: SensorDesign({}, {}, 0, True, {"sensor0_x_m": AVOID}), r"SensorDesign\.genes"),
        (lambda: SensorDesign({}, {}, 0, True, {"a": AVOID, "b": AVOID}), "twice"),
        (lambda: SensorDesign({}, {}, 0, "yes"), r"SensorDesign\.mirrored"),  # type: ignore[arg-type]
    ],
)
def test_a_bad_value_is_refused_in_one_line(make: Callable[[], object], message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        make()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("region", "mirrored", "message"),
    [
        (Region([0.2, 0.31], 0, 0), False, r"regions\.front: x extends from 0.2 to 0.31 m"),
        (Region(0, [0, 0.21], 0), False, r"regions\.front: y extends from 0 to 0.21 m"),
        (Region(0, 0, 0, link="roof"), False, r"front\.link.*roof.*base, mast, door"),
        (Region(0, 0, 0, link="mast"), False, r"front\.z_m"),
        (Region([-0.2, 0], 0, 0, z_m=0, link="mast"), False, "x extends from -0.3 to -0.1 m"),
        (Region(0.06, 0, 0, z_m=0, link="door"), False, "y extends from 0.21 to 0.21 m"),
        (Region(0, 0, 0, z_m=0, link="door"), True, "mirrored"),
        (Region(0, 0, 0, z_m=5), False, r"regions\.front: z .*0\.2 m\), not 5 to 5"),
        (Region(0, 0, 0, z_m=[0.1, 0.26]), False, "z .* not 0.1 to 0.26"),
        (Region(0, 0, 0, z_m=-0.01), False, "z .* not -0.01"),
        (Region(0, 0, 0, z_m=-0.31, link="mast"), False, "z .* not -0.01"),
        (Region(0, 0, 0, z_m=0.051, link="mast"), False, "z .* not 0.351"),
        (Region(0, 0, 0, z_m=0.26, overhang_m=0), False, "z .* at most 0 m"),
        (Region([0.2, 0.26], 0, 0, overhang_m=0), False, "x .* more than 0 m outside"),
    ],
)
def test_a_region_away_from_the_robot_is_refused(
    region: Region, mirrored: bool, message: str
) -> None:
    design = SensorDesign({"sonar": Sonar()}, {"front": region}, 1, mirrored)
    with pytest.raises(InputError, match=message) as caught:
        design.bind(ROBOT)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "region",
    [
        Region(0.25 + 0.05, 0, [-1, 1]),
        Region(0, -0.15 - 0.05, [-1, 1]),
        Region(0, 0, [-1, 1], z_m=[0, 0.2 + 0.05]),
        Region(0, 0, [-1, 1], z_m=[-0.3, 0.05], link="mast"),
    ],
)
def test_a_region_may_stand_out_by_a_bracket(region: Region) -> None:
    def size(region: Region) -> int:
        return SensorDesign({"sonar": Sonar()}, {"edge": region}, 1, True).bind(ROBOT).size

    assert size(region) > 0
    with pytest.raises(InputError, match=r"(more than|at most) 0\.049 m"):
        size(replace(region, overhang_m=0.049))


def test_the_default_place_of_a_sensor_may_be_above_what_touches_obstacles() -> None:
    flat = replace(ROBOT, height_m=0.07)
    for z_m in (None, 0.166, 0.2):
        region = Region(0, 0, [-1, 1], z_m=z_m)
        assert SensorDesign({"sonar": Sonar()}, {"top": region}, 1, True).bind(flat).size == 1
    with pytest.raises(InputError, match=r"not -0\.1"):
        FRONT.bind(replace(ROBOT, mount_z_m=-0.1), True, "design.regions.front")


def test_a_region_that_is_on_the_robot_may_have_its_twin_off_it() -> None:
    # y from -0.05 to 0.25 m
    lopsided = replace(ROBOT, outline=ROBOT.outline + np.array([0, 0.1]))
    left = {"left": Region(x_m=0, y_m=[0.1, 0.2], yaw_deg=90)}
    assert SensorDesign({"sonar": Sonar()}, left, 1, False).bind(lopsided).size == 1
    with pytest.raises(InputError, match=r"from -0\.2 to 0\.2 m"):
        SensorDesign({"sonar": Sonar()}, left, 1, True).bind(lopsided)
