"""SDF 1.0, whose attributes became elements: the same worlds in both forms."""

import logging
from collections.abc import Mapping

import pytest
from fixture_types import Log
from hypothesis import given
from hypothesis import strategies as st
from sdf_cases import unhurried, world

from evoros.base.errors import InputError
from evoros.formats.sdf.reader import SdfWorld, read_sdf
from evoros.geometry.shapes import Body

lengths = st.floats(0.1, 5.0)
flags = st.sampled_from(["true", "false"])


def old(content: str) -> SdfWorld:
    text = f"<?xml version='1.0'?><gazebo version='1.0'><world name='w'>{content}</world></gazebo>"
    return read_sdf(text.encode(), "w.world")


def describe(bodies: tuple[Body, ...]) -> list[object]:
    return [(b.name, b.pose, b.shapes, b.mass, b.friction, b.inertia) for b in bodies]


@given(lengths, lengths, flags, st.sampled_from(["box", "sphere", "cylinder", "plane"]))
@unhurried
def test_both_forms_give_the_same_bodies(a: float, b: float, static: str, kind: str) -> None:
    attributes = {
        "box": {"size": f"{a} {b} 1"},
        "sphere": {"radius": f"{a}"},
        "cylinder": {"radius": f"{a}", "length": f"{b}"},
        "plane": {"normal": "0 0 1"},
    }[kind]
    moments = {"ixx": a, "ixy": 0, "ixz": 0, "iyy": a, "iyz": 0, "izz": a}
    before = (
        f"<model name='m' static='{static}'><origin pose='{a} 2 3 0 0 {b}'/>"
        f"<link name='l'><origin pose='0 0 {b} 0 0 0'/><inertial mass='{b}'>"
        f"<origin pose='0 0 {a} 0 0 0'/><inertia {_as_attributes(moments)}/></inertial>"
        f"<collision name='c'><origin pose='{b} 0 0 0 0 0'/>"
        f"<geometry><{kind} {_as_attributes(attributes)}/></geometry>"
        f"<surface><friction><ode mu='{a}' mu2='{a}'/></friction></surface></collision>"
        "</link></model>"
    )
    after = (
        f"<model name='m'><static>{static}</static><pose>{a} 2 3 0 0 {b}</pose>"
        f"<link name='l'><pose>0 0 {b} 0 0 0</pose><inertial><mass>{b}</mass>"
        f"<pose>0 0 {a} 0 0 0</pose><inertia>{_as_elements(moments)}</inertia></inertial>"
        f"<collision name='c'><pose>{b} 0 0 0 0 0</pose>"
        f"<geometry><{kind}>{_as_elements(attributes)}</{kind}></geometry><surface><friction><ode>"
        f"<mu>{a}</mu><mu2>{a}</mu2></ode></friction></surface></collision></link></model>"
    )
    assert describe(old(before).bodies) == describe(world(after, "1.2"))


def _as_attributes(values: Mapping[str, object]) -> str:
    return " ".join(f"{name}='{value}'" for name, value in values.items())


def _as_elements(values: Mapping[str, object]) -> str:
    return "".join(f"<{name}>{value}</{name}>" for name, value in values.items())


def test_gravity_and_joints_are_read_and_the_version_is_told(caplog: Log) -> None:
    solid = "<collision name='c'><geometry><box size='1 1 1'/></geometry></collision>"
    links = "".join(f"<link name='{name}'>{solid}</link>" for name in "ab")
    joint = "<joint name='j' type='revolute'><parent link='a'/><child link='b'/><axis xyz='0 0 1'>"
    with caplog.at_level(logging.WARNING):
        read = old(
            "<physics type='ode'><gravity xyz='0 0 -1.6'/></physics>"
            f"<model name='m'>{links}{joint}<limit lower='0' upper='1'/></axis></joint></model>"
        )
    assert read.gravity_mps2 == 1.6
    (body,) = read.bodies  # of both links
    assert len(body.shapes) == 2
    assert any("is SDF 1.0: 8 attributes" in message for message in caplog.messages)


def test_includes_of_files_mean_the_models_of_their_names() -> None:
    files = ("ground_plane.model", "sun.light")
    (ground,) = old("".join(f"<include filename='{file}'/>" for file in files)).bodies
    assert ground.shapes[0].kind == "plane"
    with pytest.raises(InputError, match=r"names tower\.model"):
        old("<include filename='tower.model'/>")


def test_the_later_form_under_the_old_version_is_read_as_it_is(caplog: Log) -> None:
    box = "<geometry><box><size>1 2 3</size></box></geometry>"
    model = (
        "<model name='m'><static>1</static><link name='l'><collision name='c'>"
        f"{box}</collision></link></model>"
    )
    assert describe(old(model).bodies) == describe(world(model))
    assert not any("attributes" in message for message in caplog.messages)


def test_an_error_in_a_rewritten_element_has_its_line() -> None:
    link = "<link name='l'><collision name='c'><geometry>\n<box size='1 x 1'/>"
    text = f"\n<model name='m' static='1'>\n{link}</geometry></collision></link></model>"
    with pytest.raises(InputError, match=r"^w\.world:4: <size> .*'x'"):
        old(text)
