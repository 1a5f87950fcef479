"""The lidar, the infrared and the multizone range finder: their rays, and what they see."""

import math

import numpy as np
import pandas as pd
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from planar_cases import experiment, put, rover, start, world_of

from evoros.analysis.report.playback import MAX_SECTORS
from evoros.analysis.tables.readings import find_nearest, group_ranges, merge_sectors
from evoros.base.arrays import Array
from evoros.config.compose import compose
from evoros.filter.growing_noise import GrowingNoise
from evoros.filter.protocol import Channels
from evoros.geometry.shapes import Pose, Shape
from evoros.robot.model import Robot
from evoros.sensor.infrared import Infrared
from evoros.sensor.lidar import Lidar
from evoros.sensor.multizone import Multizone
from evoros.sensor.protocol import Mount, sensor_bearings
from evoros.simulator.engines.planar_layout import SPACING, sight_of
from evoros.simulator.engines.planar_sensing import UNSURE_RAD, estimate_bearing, find_span
from evoros.simulator.engines.planar_sensing import Fan as Sweep
from evoros.simulator.planar import Planar
from evoros.simulator.protocol import open_alone
from evoros.storage.figure_context import describe_experiment


def equip(lidar: Lidar, yaw_deg: float = 0.0, pitch_deg: float = 0.0) -> Robot:
    bare = rover()
    mount = Mount("lidar", bare.mount_link, 0.1, 0.05, 0.1, yaw_deg, pitch_deg)
    return bare.with_sensors([mount], {"lidar": lidar})


@settings(deadline=None)
@given(st.floats(1.0, 360.0), st.integers(3, 400))
def test_beams_are_even_from_the_right_edge_to_the_left(fov: float, beams: int) -> None:
    bearings = np.degrees(np.unwrap(sensor_bearings(Lidar(fov_deg=fov, beams=beams))))
    space = fov / (beams if fov == 360.0 else beams - 1)
    assert np.allclose(np.diff(bearings), space, rtol=0, atol=1e-9)
    assert bearings[-1] - bearings[0] <= fov + 1e-9
    rays = Lidar(fov_deg=fov, beams=beams).rays()
    assert np.array_equal(rays[::-1] * (1.0, -1.0, 1.0), rays)


@settings(deadline=None, max_examples=30)
@given(
    st.floats(-180.0, 180.0), st.sampled_from([30.0, 200.0, 360.0]), st.floats(-math.pi, math.pi)
)
@example(-3.0, 360.0, 2.75)  # an obstacle across the last beam, a turn from the first
def test_a_scan_is_that_of_beams_computed_one_by_one(yaw: float, fov: float, turn: float) -> None:
    """A beam with two equal rays is computed by itself, and not as a part of an even scan."""
    lidar = Lidar(fov_deg=fov, beams=90)
    world, rng = experiment().world["boxes"], np.random.default_rng(round(abs(turn) * 1e6))
    robots = equip(lidar, yaw), equip(Twofold(fov_deg=fov, beams=90), yaw)
    scans, spacings = [], []
    pose = (*rng.uniform(-6.0, 6.0, 2), turn)
    for robot in robots:
        with open_alone(Planar().open, robot, world) as simulation:
            put(simulation, *pose)
            ranges = np.zeros(90)
            simulation.sense(ranges)
            scans.append(ranges)
            spacings.append(float(sight_of(simulation.parameters, 0).groups[0, SPACING]))
    assert spacings[0] > 0.0 == spacings[1]
    assert np.array_equal(scans[0], scans[1])


@given(st.floats(-math.pi, math.pi), st.floats(1e-6, 1e6))
def test_an_estimated_bearing_is_well_within_the_margin(bearing: float, distance: float) -> None:
    x, y = distance * math.cos(bearing), distance * math.sin(bearing)
    assert abs(estimate_bearing(x, y) - math.atan2(y, x)) < 2e-5 < UNSURE_RAD


@given(st.floats(0.0, 0.999999), st.floats(-math.pi, math.pi))
def test_a_span_covers_the_whole_circle(sine: float, bearing: float) -> None:
    fan = Sweep(0, 360, 0.0, 1.0, 5.0, 0, (0.0, 0.0, 0.0))
    low, high = find_span(fan, math.cos(bearing), math.sin(bearing), sine)
    assert high - low >= 2.0 * math.asin(sine)


class Twofold(Lidar):
    """A lidar with each ray twice."""

    def rays(self) -> Array:
        return np.repeat(super().rays(), 2, axis=0)

    def channel_of(self) -> "np.ndarray[tuple[int, ...], np.dtype[np.int64]]":
        return np.repeat(super().channel_of(), 2)


def test_a_scan_of_a_wall_has_the_distances_of_geometry() -> None:
    """A wall 2 m ahead, seen at a bearing b, is 2 / cos b away."""
    lidar = Lidar(fov_deg=120.0, beams=61, range_max_m=3.0)
    wall = Shape("box", (1.0, 40.0, 2.0)), Pose((2.6, 0.0, 0.5))
    simulation = start(world_of(wall), equip(lidar))
    ranges = np.zeros(61)
    simulation.sense(ranges)
    expected = np.minimum(2.0 / np.cos(sensor_bearings(lidar)), 3.0)
    assert np.allclose(ranges, expected, rtol=0, atol=1e-9)


def test_an_infrared_sees_what_is_in_its_cone_and_is_noisier_far_away() -> None:
    infrared = Infrared()
    angles = np.degrees(np.arccos(infrared.rays()[:, 0]))
    assert angles[0] == 0.0
    assert np.allclose(angles[1:], 2.5)
    noise = GrowingNoise(0.001, 0.05)
    count = 4000
    limits = np.full(count, 0.0), np.full(count, 0.8)
    channels = Channels(*limits, np.zeros((count, 3)), 0.1)
    for distance in (0.2, 0.6):
        rng, values = np.random.default_rng(0), np.full(count, distance)
        noise.rule(noise.start(channels, np.zeros(count), rng), rng, values, 0.0)
        assert values.std() == pytest.approx(0.001 + 0.05 * distance**2, rel=0.05)
    nothing = np.full(count, 0.8)
    noise.rule(noise.start(channels, np.zeros(count), rng), rng, nothing, 0.0)
    assert (nothing == 0.8).all()


def test_the_example_evolves_a_field_of_view_and_describes_its_bearings() -> None:
    example = compose(["experiment=lidar"]).build()
    fields = []
    for share in (0.0, 1.0):
        design = example.space.decode(np.full(example.space.size, share))
        robot = example.members[0].with_design(design).robot
        lidar = robot.sensors["lidar"]
        assert isinstance(lidar, Lidar)
        fields.append(lidar.fov_deg)
        assert robot.channel_count == robot.beam_count == 360
        assert design.mounts[0].pitch_deg == 0.0
    assert fields == [20.0, 270.0]
    beam = describe_experiment(example).beams["lidar"]
    assert len(beam.bearings_deg) == 360
    assert beam.bearings_deg[0] == pytest.approx(-179.5)
    sonars = describe_experiment(experiment()).beams
    assert all(not sonar.bearings_deg for sonar in sonars.values())


def test_ranges_are_shown_by_sensor_and_sector() -> None:
    scan = {f"range_1_{k}_m": [float(k + 1), math.nan] for k in range(72)}
    table = pd.DataFrame({"time_s": [0.0, 0.1], "range_0_m": [3.0, 2.0], **scan})
    sonar, lidar = group_ranges(table).values()
    assert sonar[:, 0].tolist() == [3.0, 2.0]
    assert lidar.shape == (2, 72)
    nearest = find_nearest(lidar)
    assert nearest[0] == 1.0
    assert math.isnan(nearest[1])
    bearings = np.linspace(90.0, -90.0, 72)  # from the left, so that the last range is rightmost
    sectors = merge_sectors(lidar, bearings.tolist(), MAX_SECTORS)
    assert len(sectors) == MAX_SECTORS
    assert [sector[0] for sector in sectors] == [71.0 - 2 * k for k in range(MAX_SECTORS)]


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
