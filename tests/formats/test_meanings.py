"""Numbers that mean something else than their value, by the specifications of URDF and SDF."""

import math

import pytest
from drive_cases import FRONT, REAR, Y, choose, joint, link, steered
from drive_cases import read as read_urdf
from hypothesis import given
from hypothesis import strategies as st
from lxml import etree
from sdf_cases import MASS, read, world

from evoros.base.errors import InputError
from evoros.drive.ackermann import DEFAULT_STEERING_RAD
from evoros.drive.automatic import AutomaticDescription
from evoros.drive.candidates import DEFAULT_SPEED_MPS
from evoros.formats.strict_xml import HUGE, MEANINGS, interpret
from evoros.formats.urdf.parts import Joint
from evoros.formats.urdf.sensors import DescribedSensor, read_sensors

INFINITE = ("inf", "1e16", "1.79769e+308")
NO_LIMIT = ("-1", "-1.0", "-0.001", "-1e16", "0", "0.0", *INFINITE)
"""Stand for no limit: SDFormat's defaults before and from 1.6, and what exports write."""


def limited(limit: str, kind: str = "continuous") -> Joint:
    wheel = joint("j", "w", "0 0.1 0.05", kind, more=f"{Y}<limit {limit}/>")
    return read_urdf(link("w"), wheel).joints["j"]


@pytest.mark.parametrize("value", NO_LIMIT)
@pytest.mark.parametrize("name", ["effort", "velocity"])
def test_a_limit_that_stands_for_none_is_that_of_a_joint_without_one(name: str, value: str) -> None:
    assert getattr(limited(f'{name}="{value}"'), name) == getattr(limited(""), name) == math.inf


@given(st.floats(1e-6, HUGE, exclude_max=True))
def test_every_other_limit_is_its_value(value: float) -> None:
    read = limited(f'effort="{value!r}" velocity="{value!r}"')
    assert (read.effort, read.velocity) == (value, value)
    for field in MEANINGS:
        assert interpret(field, value) == value


@given(st.floats(-10.0, 10.0), st.floats(-10.0, 10.0))
def test_bounds_keep_their_sign_and_are_switched_when_they_are_exchanged(
    a: float, b: float
) -> None:
    """``parser_urdf.cc`` of sdformat switches them for revolute joints."""
    read = limited(f'lower="{a!r}" upper="{b!r}" effort="1" velocity="1"', "revolute")
    assert (read.lower, read.upper) == (min(a, b), max(a, b))


@pytest.mark.parametrize("value", INFINITE)
def test_huge_bounds_are_none(value: str) -> None:
    read = limited(f'lower="-{value}" upper="{value}" effort="1" velocity="1"', "revolute")
    assert (read.lower, read.upper) == (-math.inf, math.inf)
    steering = steered("revolute", f'<limit lower="-{value}" upper="{value}"/>')
    assert choose(steering, REAR).steering_limit_rad == DEFAULT_STEERING_RAD


@pytest.mark.parametrize("bounds", ["", 'lower="0.1" upper="0.6"', 'lower="-1" upper="-1"'])
def test_steering_that_cannot_turn_both_ways_is_named_with_its_bounds(bounds: str) -> None:
    motor = 'effort="1" velocity="1"'
    read = limited(f"{bounds} {motor}", "revolute")
    stated = f"left_steering_hinge_joint' turns from {read.lower:g} to {read.upper:g} rad; widen"
    parts = (steered("revolute", f"<limit {bounds} {motor}/>") + REAR).replace(
        Y, f"{Y}<limit {motor}/>"
    )
    urdf = read_urdf(parts)
    with pytest.raises(InputError, match=stated):
        AutomaticDescription().fit(urdf)


@pytest.mark.parametrize("value", NO_LIMIT)
def test_wheels_without_a_limit_have_the_default_speed(value: str) -> None:
    parts = (FRONT + REAR).replace(Y, f'{Y}<limit effort="5" velocity="{value}"/>')
    assert choose(parts).max_speed_mps == DEFAULT_SPEED_MPS


def test_a_limit_that_is_no_number_is_refused() -> None:
    with pytest.raises(InputError, match="must have a number for velocity, not 'fast'; write"):
        limited('velocity="fast"')


def solid(surface: str) -> str:
    sphere = "<geometry><sphere><radius>1</radius></sphere></geometry>"
    collision = f"<collision name='c'>{sphere}<surface>{surface}</surface></collision>"
    return f"<model name='m'><link name='l'>{MASS}{collision}</link></model>"


@pytest.mark.parametrize("value", ["-1", "-0.5", "1e16", "inf", "3.40282e+38"])
def test_a_negative_or_huge_friction_has_no_limit(value: str) -> None:
    """``FrictionPyramid::SetMu`` makes the largest number of a negative coefficient."""
    (body,) = read(solid(f"<friction><ode><mu>{value}</mu></ode></friction>"))
    assert body.friction == HUGE


def test_a_friction_of_0_slides() -> None:
    (body,) = read(solid("<friction><ode><mu>0</mu></ode></friction>"))
    assert body.friction == 0.0


@pytest.mark.parametrize(
    ("contact", "touches"),
    [
        ("<collide_bitmask>0</collide_bitmask>", False),
        ("<collide_bitmask>0x00</collide_bitmask>", False),
        ("<collide_without_contact>true</collide_without_contact>", False),
        ("<collide_bitmask>65535</collide_bitmask>", True),
        ("<collide_bitmask>0x01</collide_bitmask>", True),
        ("<collide_without_contact>0</collide_without_contact>", True),
        # Masks have 16 bits, and either of the two is enough to collide with all bits of another.
        ("<collide_bitmask>0x10000</collide_bitmask>", False),
        ("<collide_bitmask>0</collide_bitmask><category_bitmask>4</category_bitmask>", True),
        ("<collide_bitmask>4</collide_bitmask><category_bitmask>0</category_bitmask>", True),
        # The mask overrides the flag.
        ("<collide_without_contact>1</collide_without_contact><collide_bitmask>3</collide_bitmask>",
         True),
    ],
)  # fmt: skip
def test_a_collision_that_touches_nothing_is_left_out(contact: str, touches: bool) -> None:
    assert bool(world(solid(f"<contact>{contact}</contact>"))) == touches


def test_a_collision_that_may_have_no_contact_is_left_out() -> None:
    model = solid("")
    for count, touches in (("0", False), ("10", True), ("-1", True)):
        limited_to = f"<collision name='c'><max_contacts>{count}</max_contacts>"
        assert bool(world(model.replace("<collision name='c'>", limited_to))) == touches


def ray(rate: str, furthest: str) -> dict[str, float]:
    return dict(sensor(rate, furthest).settings)


def sensor(rate: str, furthest: str) -> DescribedSensor:
    scan = "<scan><horizontal><samples>9</samples></horizontal></scan>"
    span = f"<range><min>0.1</min><max>{furthest}</max></range>"
    text = f"<sensor type='ray'><update_rate>{rate}</update_rate><ray>{scan}{span}</ray></sensor>"
    robot = etree.fromstring(f"<robot><gazebo reference='l'>{text}</gazebo></robot>")
    read = read_sensors(robot)
    assert not read.left_out
    return read.sensors[0]


@pytest.mark.parametrize("rate", ["0", "-1", "inf"])
def test_a_rate_that_is_none_is_a_reading_at_every_step(rate: str) -> None:
    """The period is then left to evoros, as if the description stated none."""
    assert "period_s" not in ray(rate, "4")
    assert ray("20", "4")["period_s"] == 1 / 20


@pytest.mark.parametrize("furthest", ["inf", "1e16"])
def test_a_range_without_an_end_is_not_stated(furthest: str) -> None:
    assert "range_max_m" not in ray("20", furthest)
    assert "no maximum range" in " ".join(sensor("20", furthest).notes)
    assert ray("20", "4")["range_max_m"] == 4.0
