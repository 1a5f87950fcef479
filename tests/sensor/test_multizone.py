"""The multizone range finder: its zones, what they see, and what it costs."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from planar_cases import put, rover, start, world_of

from evoros.geometry.shapes import Pose, Shape
from evoros.sensor.multizone import Multizone
from evoros.sensor.protocol import Mount, sensor_bearings

eyes = st.builds(
    Multizone,
    fov_deg=st.floats(0.5, 170.0),
    zones=st.integers(1, 16),
    rays_per_zone=st.integers(1, 9),
)
unhurried = settings(deadline=None)  # a busy machine is no failure


@unhurried
@given(eyes)
def test_zones_share_the_field_equally_from_the_right_to_the_left(eye: Multizone) -> None:
    rays = eye.rays()
    bearings = np.degrees(np.arctan2(rays[:, 1], rays[:, 0]))
    zone = np.floor((bearings + eye.fov_deg / 2) / eye.fov_deg * eye.zones)
    assert zone.tolist() == eye.channel_of().tolist()
    middles = (np.arange(eye.zones) + 0.5) * eye.fov_deg / eye.zones - eye.fov_deg / 2
    assert np.degrees(sensor_bearings(eye)) == pytest.approx(middles, abs=1e-9)
    assert np.array_equal(rays[::-1] * (1.0, -1.0, 1.0), rays)


@given(eyes)
def test_more_zones_cost_more(eye: Multizone) -> None:
    assert eye.price == eye.base_price + eye.zone_price * eye.zones


@pytest.mark.parametrize(("zones", "seen"), [(1, [True]), (4, [False, False, True, False])])
def test_a_wide_zone_sees_a_post_but_not_where_it_is(zones: int, seen: list[bool]) -> None:
    """A post 10 deg to the left: of four zones of 20 deg, only that from 0 to 20 deg sees it."""
    eye = Multizone(fov_deg=80.0, zones=zones, rays_per_zone=60)
    mount = Mount("eye", "base_link", 0.0, 0.0, 0.3, 0.0, 0.0)
    robot = rover().with_sensors([mount], {"eye": eye})
    angle = math.radians(10.0)
    place = Pose((2.0 * math.cos(angle), 2.0 * math.sin(angle), 0.5))
    simulation = start(world_of((Shape("cylinder", (0.1, 1.0)), place)), robot)
    put(simulation, 0.0, 0.0, 0.0)
    ranges = np.zeros(zones)
    simulation.sense(ranges)
    assert (ranges < eye.range_max_m).tolist() == seen
    assert ranges.min() == pytest.approx(1.9, abs=0.01)
