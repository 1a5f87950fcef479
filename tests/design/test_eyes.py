"""The design space of eyes: what every genome gives."""

import math
from functools import cache

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from evoros.config.compose import compose
from evoros.evolution.experiment import Experiment
from evoros.sensor.multizone import Multizone

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
