"""Models with joints: vehicles, furniture with hinges, and joints to the world."""

import logging
from pathlib import Path

import pytest
from fixture_types import Log
from proposal_sites import is_of
from sdf_cases import COLLISION, LINK, load

from evoros.base.errors import InputError

DIFF = "<plugin name='drive' filename='libgazebo_ros_diff_drive.so'/>"


def wheel(number: int, kind: str = "revolute", limit: str = "") -> str:
    axis = f"<axis><xyz>0 1 0</xyz>{limit}</axis>"
    return (
        f"<link name='w{number}'>{COLLISION}</link><joint name='j{number}' type='{kind}'>"
        f"<parent>l</parent><child>w{number}</child>{axis}</joint>"
    )


CARS = [
    LINK + wheel(1) + wheel(2),
    LINK + wheel(1, "continuous") + wheel(2, "continuous"),
    LINK + wheel(1, limit="<limit><lower>-1e16</lower><upper>1e16</upper></limit>") * 1
    + wheel(2, limit="<limit><lower>-1e16</lower><upper>1e16</upper></limit>"),
    LINK + DIFF,
]  # fmt: skip


@pytest.mark.parametrize("parts", CARS)
def test_a_vehicle_is_left_out_or_held_still_and_told(
    tmp_path: Path, parts: str, caplog: Log
) -> None:
    content = f"<model name='car'>{parts}</model><model name='m'><static>1</static>{LINK}</model>"
    state = "<state><model name='car'><pose>1 0 0 0 0 0</pose></model></state>"
    with caplog.at_level(logging.WARNING):
        assert [body.name for body in load(tmp_path, content + state).bodies] == ["m"]
    told = [message for message in caplog.messages if "left out" in message]
    assert len(told) == 1
    assert told[0].startswith("w.sdf:3: <model> of model 'car'")
    assert is_of(told[0], "evoros/formats/sdf/actors.py world.NAME.vehicles=hold_still")
    caplog.clear()
    bodies = load(tmp_path, content + state, vehicles="hold_still").bodies
    assert len(bodies) > 1
    assert all(body.mass is None for body in bodies)
    assert bodies[0].pose.position == (1.0, 0.0, 0.0)
    assert sum("fixed in place" in message for message in caplog.messages) == 1


def hinge(number: int, size: str, axis: str, pose: str = "") -> str:
    """A part that turns without limits, where a hinge is."""
    box = f"<collision name='c'><geometry><box><size>{size}</size></box></geometry></collision>"
    return (
        f"<link name='p{number}'>{pose}{box}</link><joint name='j{number}' type='revolute'>"
        f"<parent>l</parent><child>p{number}</child><axis><xyz>{axis}</xyz></axis></joint>"
    )


HANDLE = (
    "<collision name='h'><geometry><cylinder><radius>.02</radius><length>.2</length></cylinder>"
    "</geometry></collision></link>"
)
LYING = "<pose>4 0 1 0 1.5708 0</pose>"
OF_MODEL, OF_LINK = "<xyz expressed_in='__model__'>", "<xyz expressed_in='l'>"


@pytest.mark.parametrize(
    "parts",
    [
        [hinge(i, ".05 .9 2", "0 0 1") for i in (1, 2)],
        [hinge(i, ".05 .9 2", "0 0 -1", f"<pose>4 {i} 1 0 0 1.57</pose>") for i in (1, 2, 3)],
        [hinge(i, "1 1 2", "0.05 0 1") for i in (1, 2)],  # turnstiles
        [hinge(i, "1 .05 .6", "1 0 0") for i in (1, 2)],  # flaps
        [hinge(i, "1 .05 .6", "1 0 0").replace("</link>", HANDLE) for i in (1, 2)],
        [
            hinge(i, "2 1 1", "1 0 0", LYING).replace("'p", "'gate_p").replace(">p", ">gate_p")
            for i in (1, 2)
        ],
        [hinge(i, "2 1 1", "0 0 1", LYING).replace("<xyz>", OF_MODEL) for i in (1, 2)],
        [hinge(i, "2 1 1", "0 0 1", LYING).replace("<xyz>", OF_LINK) for i in (1, 2)],
    ],
)
def test_a_building_with_doors_stays(tmp_path: Path, parts: list[str], caplog: Log) -> None:
    with caplog.at_level(logging.WARNING):
        (body,) = load(tmp_path, f"<model name='house'>{LINK}{''.join(parts)}</model>").bodies
    assert len(body.shapes) == 1 + "".join(parts).count("<collision")
    assert (
        sum("has joints that are simulated as fixed ('j1', 'j2'" in m for m in caplog.messages) == 1
    )


@pytest.mark.parametrize(
    "parts",
    [
        # Wheels along z of a link that lies on its side, as models of Gazebo have them.
        [hinge(i, ".3 .3 .1", "0 0 1", "<pose>0 0 0 -1.5708 0 0</pose>") for i in (1, 2)],
        # Up to SDF 1.4, the axis was in the frame of the model.
        [hinge(i, ".3 .3 .1", "0 1 0", "<pose>0 0 0 -1.5708 0 0</pose>") for i in (1, 2)],
        [hinge(i, ".05 .3 .3", "1 0 0").replace("'p", "'wheel_") for i in (1, 2)],
    ],
)
def test_wheels_stay_wheels(tmp_path: Path, parts: list[str]) -> None:
    parts = [part.replace("<child>p", "<child>wheel_" if "wheel_" in part else "<child>p")
             for part in parts]  # fmt: skip
    assert not load(tmp_path, f"<model name='car'>{LINK}{''.join(parts)}</model>").bodies


@pytest.mark.parametrize("kind", ["revolute", "prismatic", "screw", "universal", "ball"])
def test_furniture_is_held_still_at_its_joints(tmp_path: Path, kind: str, caplog: Log) -> None:
    limit = "<limit><lower>0</lower><upper>1.5</upper></limit>"
    door = LINK + wheel(1, kind, limit) + wheel(2, kind, limit)
    with caplog.at_level(logging.WARNING):
        (body,) = load(tmp_path, f"<model name='door'>{door}</model>").bodies
    assert (body.mass, len(body.shapes)) == (3.0, 3)  # it can be pushed as a whole
    assert (
        sum("has joints that are simulated as fixed ('j1', 'j2'" in m for m in caplog.messages) == 1
    )
    frame = "<joint name='f' type='fixed'><parent>world</parent><child>l</child></joint>"
    bodies = load(tmp_path, f"<model name='door'>{door}{frame}</model>").bodies
    assert [body.mass for body in bodies] == [None] * 3


def test_one_part_that_turns_freely_makes_no_vehicle(tmp_path: Path) -> None:
    fan = LINK + wheel(1, "continuous")
    (body,) = load(tmp_path, f"<model name='fan'>{fan}</model>").bodies
    assert len(body.shapes) == 2


def test_joints_of_a_static_model_move_nothing(tmp_path: Path, caplog: Log) -> None:
    with caplog.at_level(logging.WARNING):
        bodies = load(tmp_path, f"<model name='m'><static>1</static>{CARS[0]}</model>").bodies
    assert len(bodies) == 3
    assert not caplog.records


def test_a_joint_of_the_world_fixes_its_models(tmp_path: Path, caplog: Log) -> None:
    def joint(parent: str, child: str) -> str:
        ends = f"<parent>{parent}</parent><child>{child}</child>"
        return f"<joint name='j' type='revolute'>{ends}</joint>"

    models = "".join(f"<model name='{name}'>{LINK}</model>" for name in "abc")
    with caplog.at_level(logging.WARNING):
        bodies = load(tmp_path, models + joint("world", "a::l")).bodies
        assert [body.mass for body in bodies] == [None, 1.0, 1.0]
    assert sum("connected models are fixed" in message for message in caplog.messages) == 1
    bodies = load(tmp_path, models + joint("c", "a::l")).bodies
    assert [body.mass for body in bodies] == [None, 1.0, None]
    with pytest.raises(InputError, match="'d::l'"):
        load(tmp_path, models + joint("world", "d::l"))
