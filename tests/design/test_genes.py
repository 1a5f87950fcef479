"""Evolved values, regions and sensors of every design: where they are put, what is refused."""

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Annotated, Any

import numpy as np
import pytest
from design_cases import AVOID, FRONT, MIXED, ONE, ROBOT, VOTES
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from evoros.base.arrays import Array
from evoros.base.checks import POSITIVE, checked, invalid
from evoros.base.errors import InputError
from evoros.design.design import Design
from evoros.design.genes import MAX_EXHAUSTIVE, Gene, check_genes, enumerate_corners, replace_values
from evoros.design.region import Region
from evoros.design.space import FixedSensor, SensorDesign
from evoros.sensor.protocol import Mount
from evoros.sensor.sonar import Sonar
from evoros.testing import RegionSuite


@dataclass(frozen=True)
@checked
class Avoidance:
    range_m: Annotated[float, POSITIVE] = 2.0
    near_m: float = 1.0
    hidden: float = field(default=0, init=False)

    def __post_init__(self) -> None:
        if self.near_m > self.range_m:
            raise invalid(self, "near_m", self.near_m, "must be at most range_m")


@dataclass(frozen=True)
class Pilot:
    avoidance: Avoidance = Avoidance()
    layers: tuple[Avoidance, ...] = (Avoidance(), Avoidance())
    mode: str = "fast"
    votes: int = 3
    flag: bool = True


PARTS = {"controller": Pilot(), "robot": ROBOT, "design": ONE}


def test_a_value_is_replaced_where_its_path_leads_and_nowhere_else() -> None:
    values = {
        "controller.avoidance.range_m": 1.5,
        "controller.layers.1.near_m": 0.5,
        "controller.votes": 5,
        "robot.drive.max_speed_mps": 0.3,
        "design.sensors.sonar.range_max_m": 3.0,
    }
    changed: dict[str, Any] = replace_values(PARTS, values)
    assert changed["controller"] == Pilot(
        Avoidance(1.5), (Avoidance(), Avoidance(near_m=0.5)), votes=5
    )
    assert changed["robot"].drive.max_speed_mps == 0.3
    assert changed["robot"].outline is ROBOT.outline
    assert changed["design"].sensors == {"sonar": Sonar(range_max_m=3.0)}
    assert {"controller": Pilot(), "robot": ROBOT, "design": ONE} == PARTS
    assert replace_values(PARTS, {}) is PARTS


def test_values_that_are_valid_only_together_are_replaced_together() -> None:
    pilot = replace_values(Pilot(), {"avoidance.near_m": 3, "avoidance.range_m": 4})
    assert pilot.avoidance == Avoidance(4, 3)
    with pytest.raises(InputError, match=r"Avoidance\.near_m"):
        replace_values(Pilot(), {"avoidance.near_m": 3})


@pytest.mark.parametrize(
    ("path", "message"),
    [
        (
            "avoidance.rang_m",
            "avoidance.rang_m: must be the path of an existing value.*range_m, near_m",
        ),
        ("avoidance.hidden", "existing value"),
        ("avoidance", "a number, not of a Avoidance; it contains range_m"),
        ("mode", "a number, not of a str"),
        ("flag", "a number, not of a bool"),
        ("votes.more", "has no values"),
        ("layers.2.range_m", "has 0, 1"),
        ("", "existing value"),
    ],
)
def test_a_path_that_leads_to_no_number_is_refused(path: str, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        replace_values(Pilot(), {path: 1.0})
    assert "\n" not in str(caught.value)


def test_genes_are_tried_at_both_ends_before_a_run() -> None:
    check_genes({"avoid": AVOID, "votes": VOTES}, PARTS)
    key = AVOID.key
    with pytest.raises(InputError, match=rf"genes\.avoid\.low: {key} cannot be -1 \(.*range_m"):
        check_genes({"avoid": Gene(key, -1, 4), "votes": VOTES}, PARTS)
    with pytest.raises(InputError, match=r"low: .* cannot be 0\.5 .*Avoidance\.near_m"):
        check_genes({"avoid": Gene(key, 0.5, 4)}, PARTS)
    with pytest.raises(InputError, match=r"genes\.near\.high: .* cannot be 9 .*range_min_m"):
        check_genes({"near": Gene("design.sensors.sonar.range_min_m", 0.01, 9)}, PARTS)
    with pytest.raises(InputError, match=r"^design\.genes\.g: controller\.no: must be the path of"):
        check_genes({"g": Gene("controller.no", 0, 1)}, PARTS)


def test_a_whole_gene_takes_each_value_equally_often() -> None:
    values = [VOTES.value(gene) for gene in np.linspace(0, 1, 4001)]
    assert set(values) == {2, 3, 4, 5}
    assert all(abs(values.count(value) - 1000) <= 1 for value in range(2, 6))


@pytest.mark.parametrize("count", [1, MAX_EXHAUSTIVE, MAX_EXHAUSTIVE + 1, 40])
def test_corners_are_all_or_those_in_which_at_most_one_gene_differs(count: int) -> None:
    corners = list(enumerate_corners(count))
    assert len(set(corners)) == len(corners)
    assert set(itertools.chain(*corners)) == {0.0, 1.0}
    if count <= MAX_EXHAUSTIVE:
        assert len(corners) == 2**count
    else:
        assert len(corners) == 2 * (count + 1)
        assert all(min(sum(corner), count - sum(corner)) <= 1 for corner in corners)


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
    with pytest.raises(InputError, match="must have at least one entry if sensors are placed"):
        SensorDesign({"own": Sonar()}, {"front": FRONT}, 1, False, fixed={"back": MAST})


def test_a_design_of_several_robots_is_joined_from_its_parts() -> None:
    parts = {name: SPACE.decode(np.full(SPACE.size, x)) for name, x in (("", 0.2), ("other", 0.7))}
    joined = Design.join(parts).parts
    assert {name: replace(part, agents={}) for name, part in joined.items()} == parts


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
        (lambda: SensorDesign({}, {}, 0, True, {"a": AVOID, "b": AVOID}), "only once"),
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
