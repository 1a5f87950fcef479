"""Actors of SDF files: what is read of them, and how they walk."""

import logging
from dataclasses import replace

import numpy as np
import pytest
from proposal_sites import is_of
from walker_cases import crowd_of, open_world

from evoros.base.errors import InputError
from evoros.formats.sdf.actors import Actor
from evoros.formats.sdf.reader import read_sdf
from evoros.formats.sdf.reading import SdfOptions
from evoros.simulator.engines.walking import plan
from evoros.world.model import World

STEP = 0.1


def waypoints(*points: tuple[float, float, float]) -> str:
    """Waypoints of time, x, y."""
    poses = (
        f"<waypoint><time>{t}</time><pose>{x} {y} 1 0 0 0</pose></waypoint>" for t, x, y in points
    )
    return f"<trajectory id='0' type='walking'>{''.join(poses)}</trajectory>"


def read(*scripts: str, **options: str) -> tuple[Actor, ...]:
    actors = "".join(
        f"<actor name='a person {i}'><skin><filename>w.dae</filename></skin>{script}</actor>"
        for i, script in enumerate(scripts)
    )
    text = f"<sdf version='1.7'><world name='w'>{actors}</world></sdf>"
    return read_sdf(text.encode(), "w.sdf", SdfOptions(**options)).actors  # type: ignore[arg-type]


def follow(actor: Actor, seconds: float) -> np.ndarray:
    """The places (steps, 2) [m] of an actor after each step."""
    world: World = replace(open_world(), actors=(actor,))
    crowd = crowd_of({}, world)
    ways = np.zeros((round(seconds / STEP), 2))
    plan(crowd.parameters, crowd.memory, np.zeros((0, 4)), STEP, ways)
    return ways


def test_an_actor_is_at_each_waypoint_at_its_time_in_every_round() -> None:
    points = [(0.0, 1.0, 2.0), (2.0, 3.0, 2.0), (5.0, 3.0, -4.0)]
    (actor,) = read(f"<script>{waypoints(*points)}</script>")
    assert actor.name == "a_person_0"
    ways = follow(actor, 12.0)
    for turn in (0.0, 5.0):
        for time, x, y in points[1:]:
            row = round((turn + time) / STEP) - 1
            if time < 5.0:
                assert ways[row] == pytest.approx((x, y), abs=1e-6)
    assert ways[round(3.5 / STEP) - 1] == pytest.approx((3.0, -1.0), abs=1e-6)


def test_a_delay_comes_before_each_round() -> None:
    path = waypoints((0.0, 0.0, 0.0), (4.0, 4.0, 0.0))
    (actor,) = read(f"<script><delay_start>2</delay_start>{path}</script>")
    ways = follow(actor, 11.9)[:, 0]
    time = STEP * np.arange(1, len(ways) + 1)
    expected = np.clip(np.mod(time, 6.0) - 2.0, 0.0, None)
    whole = np.abs(np.mod(time, 6.0)) < 1e-6  # where a round ends and the next one begins
    assert ways[~whole] == pytest.approx(expected[~whole], abs=1e-6)


def test_an_actor_without_a_loop_stays_at_the_end() -> None:
    path = waypoints((0.0, 0.0, 0.0), (1.0, 4.0, 0.0))
    (actor,) = read(f"<script><loop>false</loop>{path}</script>")
    assert follow(actor, 9.0)[-1] == pytest.approx((4.0, 0.0))


def test_trajectories_follow_one_another() -> None:
    first = waypoints((0.0, 0.0, 0.0), (1.0, 1.0, 0.0))
    second = waypoints((0.0, 1.0, 0.0), (2.0, 1.0, 2.0))
    (actor,) = read(f"<script>{first}{second}</script>")
    assert actor.points == ((0.0, 0.0, 0.0), (1.0, 0.0, 1.0), (1.0, 2.0, 3.0))


def test_waypoints_count_by_time_and_the_last_one_of_each_time() -> None:
    path = waypoints((3.0, 3.0, 0.0), (0.0, 9.0, 9.0), (1.0, 1.0, 0.0), (0.0, 0.0, 0.0))
    (actor,) = read(f"<script>{path}</script>")
    assert actor.points == ((0.0, 0.0, 0.0), (1.0, 0.0, 1.0), (3.0, 0.0, 3.0))


def test_an_actor_with_one_time_stands_there() -> None:
    (actor,) = read(f"<script>{waypoints((100.0, 5.0, 6.0), (100.0, 5.0, 7.0))}</script>")
    assert actor.points == ((5.0, 7.0, 0.0),)


def test_actors_can_be_left_out(caplog: pytest.LogCaptureFixture) -> None:
    stated = [f"<script>{waypoints((0.0, 0.0, 0.0), (1.0, 1.0, 0.0))}</script>"] * 2
    with caplog.at_level(logging.WARNING, "evoros.sdf"):
        assert read(*stated, actors="leave_out") == ()
    (message,) = caplog.messages
    assert "w.sdf:1: <actor>" in message
    told = "evoros/formats/sdf/actors.py world.NAME.actors=walk"
    assert is_of(message, told)
    with caplog.at_level(logging.WARNING, "evoros.sdf"):
        assert len(read(*stated, actors="walk")) == 2
    assert not is_of(caplog.messages[-1], told)


@pytest.mark.parametrize(
    ("script", "says"),
    [
        (waypoints((-1.0, 0.0, 0.0)), "must be a non-negative time"),
        ("<trajectory><waypoint><time>1</time></waypoint></trajectory>", "must have a <pose>"),
    ],
)
def test_a_bad_script_is_refused_in_one_line(script: str, says: str) -> None:
    with pytest.raises(InputError, match=says) as error:
        read(f"<script>{script}</script>")
    assert "w.sdf:1:" in str(error.value)
    assert "\n" not in str(error.value)
