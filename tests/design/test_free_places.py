"""Every genome places sensors where the robot does not block their view; the space of eyes."""

import itertools
import math
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from robot_cases import rover

from evoros.config.compose import compose
from evoros.design.outline_region import OutlineRegion
from evoros.design.region import Region
from evoros.design.space import SensorDesign
from evoros.evolution.experiment import Experiment
from evoros.robot.model import Robot
from evoros.robot.outline import Occluders
from evoros.robot.self_sight import find_self_sights
from evoros.sensor.multizone import Multizone
from evoros.sensor.protocol import Mount
from evoros.sensor.sonar import Sonar


def bind(robot: Robot, regions: dict[str, Any], mirrored: bool = False) -> Any:
    return SensorDesign({"sonar": Sonar()}, regions, 3, mirrored).bind(robot)


SIDES = {side: OutlineRegion(side, [-45.0, 45.0]) for side in ("front", "left", "rear", "right")}
BOX = Region([-0.3, 0.3], [0.1, 0.4], [-90.0, 90.0], [0.1, 0.2], 0.0, overhang_m=0.2)


@settings(max_examples=20)
@given(st.data())
def test_no_genome_leads_to_a_place_that_the_robot_hides(data: st.DataObject) -> None:
    """The mule's wheels stand beside its body, where its outline carries sensors."""
    mirrored = data.draw(st.booleans())
    choices: list[dict[str, Any]] = [dict(SIDES), {"left": SIDES["left"], "box": BOX}]
    regions = data.draw(st.sampled_from(choices))
    robot = rover("mule")
    space = bind(robot, regions, mirrored)
    genome = np.array(
        data.draw(st.lists(st.floats(0, 1), min_size=space.size, max_size=space.size))
    )
    design = space.decode(genome)
    assert not list(find_self_sights(robot.with_sensors(design.mounts, {"sonar": Sonar()})))


def test_parts_that_are_smaller_than_a_cell_hide_no_place() -> None:
    """Just above the front edge of the mule's top, between corners that are free."""
    robot, sensors = rover("mule"), {"sonar": Sonar()}
    region = Region([0.2, 0.3], 0.1, -45.0, [0.1, 0.2], 0.0, overhang_m=0.2)
    edge, other = (
        bind(robot, {"edge": region}).regions["edge"],
        {"yaw_deg": -45.0, "pitch_deg": 0.0},
    )
    for x, z in itertools.product(np.linspace(0.2, 0.3, 25), np.linspace(0.1, 0.2, 25)):
        (px, py, pz), yaw, pitch = edge.place({"x_m": x, "y_m": 0.1, "z_m": z, **other})
        mount = Mount("sonar", robot.mount_link, px, py, pz, yaw, pitch)
        assert not list(find_self_sights(robot.with_sensors([mount], sensors)))


def test_what_is_left_out_is_what_is_hidden() -> None:
    """Without leaving out, a third of the same genomes lead to sonars that see a wheel."""
    robot = rover("mule")
    whole = replace(robot, occluders=Occluders())
    rng = np.random.default_rng(0)
    genomes = rng.random((200, bind(robot, dict(SIDES)).size))
    designs = [bind(whole, dict(SIDES)).decode(genome) for genome in genomes]
    sights = [
        len(list(find_self_sights(robot.with_sensors(design.mounts, {"sonar": Sonar()}))))
        for design in designs
    ]
    assert sum(sights) > 0.3 * 3 * len(genomes)


@settings(max_examples=20)
@given(st.data())
def test_free_places_keep_their_order_and_fill_the_ends(data: st.DataObject) -> None:
    """Along an axis with all else fixed, the place moves on with its gene, from end to end."""
    left = bind(rover("mule"), {"left": SIDES["left"]}).regions["left"]
    free, lowest = left.free, {name: low for name, (low, _) in left.ranges.items()}
    assert free is not None
    yaw = data.draw(st.floats(-45.0, 45.0))
    shares = sorted(data.draw(st.lists(st.floats(0, 1), min_size=2, max_size=8)))
    adapted = [free.adapt({**lowest, "arc": share, "yaw_deg": yaw})["arc"] for share in shares]
    assert adapted == sorted(adapted)
    cells = np.flatnonzero(free.free.any(axis=1))
    ends = [free.adapt({**lowest, "arc": share, "yaw_deg": yaw})["arc"] for share in (0.0, 1.0)]
    assert ends == pytest.approx([cells[0] / len(free.free), (cells[-1] + 1) / len(free.free)])


def test_a_robot_that_hides_nothing_leaves_all_places() -> None:
    for name in ("erle_rover", "two_wheeler", "courier"):
        assert all(
            region.free is None for region in bind(rover(name), dict(SIDES)).regions.values()
        )


unhurried = settings(max_examples=25)


@cache
def experiment() -> Experiment:
    return compose(["experiment=eyes_navigation"]).build()


@unhurried
@given(st.integers(0, 2**32))
def test_every_genome_gives_equal_eyes_on_the_rim_that_face_outwards(seed: int) -> None:
    one = experiment()
    genome = np.random.default_rng(seed).random(one.space.size)
    design = one.space.decode(genome)
    assert 1 <= len(design.mounts) <= 8
    robot = one.members[0].with_design(design).robot
    assert {mount.sensor for mount in design.mounts} == {"multizone"}
    eye = robot.sensors["multizone"]
    assert isinstance(eye, Multizone)
    assert 1 <= eye.zones <= 8
    assert 1.0 <= eye.fov_deg <= 100.0
    assert robot.channel_count == len(design.mounts) * eye.zones <= 64
    radius = np.abs(one.robot.outline).max()
    for mount in design.mounts:
        assert math.isclose(math.hypot(mount.x_m, mount.y_m), radius, rel_tol=0.02)
        bearing = math.degrees(math.atan2(mount.y_m, mount.x_m))
        assert abs((mount.yaw_deg - bearing + 180.0) % 360.0 - 180.0) < 6.0  # a polygon's side


def test_places_cover_the_whole_rim_evenly() -> None:
    one, rng = experiment(), np.random.default_rng(0)
    designs = [one.space.decode(rng.random(one.space.size)) for _ in range(200)]
    bearings = [math.atan2(m.y_m, m.x_m) for design in designs for m in design.mounts]
    counts = np.histogram(bearings, 6, (-math.pi, math.pi))[0]
    mean = len(bearings) / 6
    assert (np.abs(counts - mean) < 5 * math.sqrt(mean)).all()
