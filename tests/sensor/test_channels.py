"""Sensors with several channels: their names, their beams, their filters and their failures."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, partial

import numpy as np
import pytest
from comb import Comb
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from planar_cases import experiment, put, rover
from sensor_cases import start_chain

from evoros.base.errors import InputError
from evoros.base.rng import generator
from evoros.controller.briefing_text import describe_briefing
from evoros.controller.line_controller import _group
from evoros.controller.protocol import Briefing
from evoros.controller.weighted_voting import WeightedVoting
from evoros.failure.random import RandomFailure
from evoros.filter.protocol import Filter
from evoros.robot.model import Robot
from evoros.sensor.protocol import Channel, Mount, Sensor, name_channels, sees, sensor_bearings
from evoros.simulator.engines.rays import sensor_beams
from evoros.simulator.planar import Planar
from evoros.simulator.protocol import open_alone

FAR_M = 3.0


@dataclass(frozen=True)
class Unsorted(Comb):
    """Its last channel has no ray."""

    def channel_of(self) -> NDArray[np.int64]:
        return np.zeros(len(self.bearings_deg), dtype=np.int64)


@dataclass(frozen=True)
class Compass(Sensor):
    """A sensor that casts no rays."""

    measures = "heading"
    channels = (
        Channel("heading", "rad", -math.pi, math.pi),
        Channel("tilt", "rad", -math.pi, math.pi),
    )
    period_s: float = 0.1
    size_m: Sequence[float] = (0.01, 0.01, 0.01)
    mass_kg: float = 0.01
    price: float = 1.0
    filters: Mapping[str, Filter] = field(default_factory=dict)


@cache
def bare() -> Robot:
    return rover()


def equip(*mounts: tuple[str, float], **sensors: Comb | Compass) -> Robot:
    """The rover with sensors of these types at these yaws, all at one place."""
    link = bare().mount_link
    places = [Mount(kind, link, 0.2, 0.05, 0.1, yaw, 0.0) for kind, yaw in mounts]
    return bare().with_sensors(places, sensors)


def test_channels_are_numbered_only_where_a_sensor_has_several_of_a_name() -> None:
    sensors: list[Sensor] = [Comb((0.0,)), Comb((0.0, 1.0)), Compass()]
    assert list(name_channels(sensors)) == [
        "range_0_m", "range_1_0_m", "range_1_1_m", "heading_2_rad", "tilt_2_rad",
    ]  # fmt: skip


@settings(deadline=None)
@given(st.lists(st.sampled_from(["one", "comb", "compass"]), max_size=5))
def test_each_mount_has_its_part_of_the_readings(kinds: list[str]) -> None:
    sizes = {"one": 1, "comb": 3, "compass": 2}
    robot = equip(
        *((kind, 0.0) for kind in kinds), one=Comb((0.0,)), comb=Comb(), compass=Compass()
    )
    ordered = [mount.sensor for mount in robot.mounts]
    assert [part.stop - part.start for part in robot.layout] == [sizes[kind] for kind in ordered]
    whole = [i for part in robot.layout for i in range(part.start, part.stop)]
    assert whole == list(range(robot.channel_count))
    assert robot.channel_count == len(list(name_channels(robot.mounted_sensors())))
    beams = [i for part in robot.beam_layout for i in range(part.start, part.stop)]
    assert beams == list(range(robot.beam_count))
    assert robot.beam_count == len(sensor_beams(robot))
    assert np.isnan(robot.channel_yaws()).sum() == 2 * kinds.count("compass")


def test_a_beam_of_many_reads_as_a_sensor_that_faces_its_way() -> None:
    """The yaws of separate sensors and the bearings of one name the same rays."""
    bearings, yaw = (-100.0, -30.0, 0.0, 55.0, 170.0), 20.0  # the last one beyond a half turn
    world = experiment().world["boxes"]
    comb = equip(("comb", yaw), comb=Comb(bearings))
    apart = equip(*(("one", yaw + bearing) for bearing in bearings), one=Comb((0.0,)))
    assert np.allclose(np.exp(1j * (np.array(comb.channel_yaws()) - apart.channel_yaws())), 1.0)
    assert np.allclose(np.degrees(sensor_bearings(Comb(bearings))), bearings)
    together, separate = np.zeros(len(bearings)), np.zeros(len(bearings))
    rng, seen = np.random.default_rng(0), 0
    for _ in range(200):
        pose = rng.uniform((-8, -8, -3), (8, 8, 3))
        for robot, ranges in ((comb, together), (apart, separate)):
            with open_alone(Planar().open, robot, world) as simulation:
                put(simulation, *pose)
                simulation.sense(ranges)
        assert np.allclose(together, separate, rtol=0, atol=1e-9)
        seen += int((together < FAR_M).sum())
    assert seen > 50


def test_a_failure_silences_all_channels_of_a_sensor_and_no_other() -> None:
    robot = equip(("comb", 0.0), ("comb", 90.0), ("one", 0.0), comb=Comb(), one=Comb((0.0,)))
    draws = partial(generator, "test")
    hit = set()
    for seed in range(20):
        failure = RandomFailure(1, 0.0, 1.0)
        faults = failure.draw(robot.describe_sensors(), generator(f"{seed}", "failure"))
        assert len(faults[0].onset) == 3
        ranges, readings = np.arange(1.0, 8.0), np.zeros(7)
        for stage in start_chain(robot, faults, ranges, readings, draws):
            stage.rule(*stage[2:7], 2.0)
        (failed,) = np.flatnonzero(np.isfinite(faults[0].onset))
        silent = np.zeros(7, dtype=bool)
        silent[robot.layout[failed]] = True
        assert np.array_equal(np.isnan(readings), silent)
        assert np.array_equal(readings[~silent], ranges[~silent])
        hit.add(int(failed))
    assert hit == {0, 1, 2}


def vote(robot: Robot, readings: Sequence[float]) -> float | None:
    """The share of full lock, or None without a decision."""
    parameters, command = WeightedVoting().start(robot, 0.1, generator("", "")), np.zeros(2)
    decided = WeightedVoting.rule(parameters, np.array(readings, dtype=float), command)
    return float(command[1]) / robot.drive.steering_limit if decided else None


def test_a_sensor_votes_for_each_side_once_with_its_nearest_reading() -> None:
    many = equip(("comb", 0.0), comb=Comb((-40.0, -20.0, 20.0, 40.0)))
    two = equip(("one", -40.0), ("one", 40.0), one=Comb((0.0,)))
    assert vote(many, [FAR_M] * 4) is None
    assert vote(many, [math.nan] * 4) is None
    for right, left in ((0.5, 3.0), (3.0, 1.2), (1.0, 1.5), (0.2, 0.1)):
        assert vote(many, [right, right + 0.1, left, left + 0.4]) == vote(two, [right, left])


def test_a_compass_has_no_vote() -> None:
    robot = equip(("one", 30.0), ("compass", 0.0), one=Comb((0.0,)), compass=Compass())
    assert vote(robot, [3.0, 0.1, 0.1]) is None
    assert vote(robot, [1.0, -1.0, 0.1]) == -0.5


def test_programs_are_told_a_list_for_a_sensor_with_several_channels() -> None:
    robot = equip(("one", 0.0), ("comb", 0.0), ("compass", 0.0),
                  one=Comb((0.0,)), comb=Comb(), compass=Compass())  # fmt: skip
    told = _group(np.arange(6.0), robot.layout)
    assert told[0] == 0.0
    assert [values.tolist() for values in told[1:]] == [[1.0, 2.0, 3.0], [4.0, 5.0]]
    home = (0.0, 0.0, 0.0, 0.0)
    one, comb, compass = describe_briefing(Briefing(robot, home, np.zeros((1, 2)), 1, 1, 0))[
        "sensors"
    ]
    assert "bearings_rad" not in one
    assert np.allclose(np.degrees(comb["bearings_rad"]), Comb().bearings_deg)
    assert compass["channels"] == ["heading_rad", "tilt_rad"]
    assert "range_max_m" not in compass


def test_a_channel_without_a_ray_is_refused() -> None:
    broken = Unsorted()
    assert sees(broken)
    robot = equip(("broken", 0.0), broken=broken)
    with pytest.raises(
        InputError, match=r"Unsorted\.channel_of: must return a channel from 0 to 2"
    ):
        sensor_beams(robot)
