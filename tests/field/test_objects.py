"""Objects of two sizes: where they stand, which draws move them, and what is refused."""

import math
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evoros.base.errors import InputError
from evoros.config.compose import compose
from evoros.field.drawn import FIXED
from evoros.field.objects import BEHIND_M, Objects, generate_objects
from evoros.formats.sdf.reader import read_sdf
from evoros.world.course import Course
from evoros.world.model import World

COURSE = Course(1.0, -2.0, 0.08, 0.3, [[3.0, -2.0]], 0.5, 25.0, "one_way", True)
SCENE = Objects(COURSE, 0.2, 1.0, 2, [1.5, 2.5], 60.0, 0.5)
unhurried = settings(deadline=None, max_examples=30)


def places(world: World) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """The distances [m] and bearings [rad] of the objects from home."""
    offsets = np.array([b.pose.position[:2] for b in world.obstacles]) - world.course.home[:2]
    return np.hypot(*offsets.T), np.arctan2(offsets[:, 1], offsets[:, 0])


@unhurried
@given(st.integers(0, 10**6), st.integers(1, 3), st.floats(0.0, 55.0))  # room for three
def test_objects_are_apart_and_at_their_distances(seed: int, decoys: int, apart: float) -> None:
    one = replace(SCENE, seed=seed, decoys=decoys, apart_deg=apart)
    world = one.draw_world("x")
    far, bearings = places(world)
    assert [body.name.split("_")[0] for body in world.obstacles] == ["target", *["decoy"] * decoys]
    assert far[0] == pytest.approx(2.0 + BEHIND_M + one.target_m / 2, abs=1e-3)
    assert bearings[0] == pytest.approx(0.0, abs=1e-3)
    nearest = far[1:] - one.decoy_m / 2
    assert ((nearest >= 1.5 - 1e-3) & (nearest <= 2.5 + 1e-3)).all()
    for i, bearing in enumerate(bearings):
        turns = np.abs(np.angle(np.exp(1j * (bearings[i + 1 :] - bearing))))
        assert (np.degrees(turns) >= apart - 0.1).all()
    goal = np.array(one.course.waypoints[0])
    decoy_places = [np.array(body.pose.position[:2]) for body in world.obstacles[1:]]
    assert all(np.linalg.norm(place - goal) > 0.5 + 0.5 - 1e-3 for place in decoy_places)
    sizes = [body.shapes[0].size[0] for body in world.obstacles]
    assert sizes == [0.1, *[0.5] * decoys]


def test_equal_seeds_and_draws_give_equal_bytes_and_others_other_decoys() -> None:
    made = [replace(SCENE, seed=s).draw_world(d).sdf for s in (0, 1) for d in (FIXED, "a")]
    assert len(set(made)) == 4
    assert Objects(**vars(SCENE)).draw_bodies("a") == SCENE.draw_bodies("a")
    assert read_sdf(made[0].encode(), "a file").bodies == SCENE.draw_world(FIXED).bodies
    fixed, renewed = generate_objects(**vars(SCENE)), generate_objects(**vars(SCENE), renew=True)
    assert fixed.at("a") is fixed
    assert renewed.at("a").bodies != renewed.at("b").bodies
    with pytest.raises(InputError, match=r"^generate_objects\.renew: [^\n]*, not [^\n]+$"):
        generate_objects(**vars(SCENE), renew="yes")  # type: ignore[arg-type]


@cache
def configured() -> dict[str, World]:
    return dict(compose(["experiment=eyes_detection"]).build().world)


def test_the_six_worlds_show_the_narrow_object_on_all_sides_and_share_their_numbers() -> None:
    worlds = configured()
    bearings = [places(world)[1][0] - world.course.home_yaw_rad for world in worlds.values()]
    assert sorted(np.degrees(bearings).round()) == [-150, -90, -30, 30, 90, 150]
    samplers = [world.sampler for world in worlds.values()]
    assert all(isinstance(sampler, Objects) for sampler in samplers)
    numbers = [{k: v for k, v in vars(sampler).items() if k != "course"} for sampler in samplers]
    assert all(values == numbers[0] for values in numbers)


def test_decoys_are_everywhere_that_is_allowed() -> None:
    """Uniform bearings outside of the forbidden third: none of four equal parts is rare."""
    one = replace(SCENE, decoys=1)
    drawn = [float(places(one.draw_world(str(key)))[1][1]) for key in range(200)]
    shares = np.histogram(np.mod(drawn, 2 * math.pi), 4, (math.pi / 3, 5 * math.pi / 3))[0] / 200
    assert shares.sum() == 1.0
    assert (np.abs(shares - 0.25) < 0.12).all()  # four standard deviations


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"target_m": 0.0}, "target_m"),
        ({"decoy_m": -1.0}, "decoy_m"),
        ({"decoys": 0}, "decoys"),
        ({"decoys": 6}, "apart_deg"),  # no room: six of 60 deg besides the narrow one
        ({"distance_m": [0.0, 1.0]}, "distance_m"),
        ({"apart_deg": 181.0}, "apart_deg"),
        ({"height_m": 0.0}, "height_m"),
        ({"seed": -1}, "seed"),
        ({"course": replace(COURSE, waypoints=[[1.0, -2.0]])}, "course"),
    ],
)
def test_a_bad_parameter_is_named(changes: dict[str, Any], key: str) -> None:
    with pytest.raises(InputError, match=rf"^Objects\.{key}: [^\n]*, not [^\n]+$"):
        replace(SCENE, **changes).draw_world(FIXED)
