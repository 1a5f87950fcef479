"""Elements that the SDF reader ignores, reports or refuses, with file, line and fix."""

import logging

import pytest
from fixture_types import Log
from hypothesis import given, settings
from hypothesis import strategies as st

from evoros.base.errors import InputError
from evoros.formats.sdf.reader import read_sdf
from evoros.geometry.shapes import Body

BOX = "<geometry><box><size>1 2 3</size></box></geometry>"
COLLISION = f"<collision name='c'>{BOX}</collision>"
LINK = f"<link name='l'>{COLLISION}</link>"
STATIC = "<static>true</static>"
MASS = "<inertial><mass>2</mass></inertial>"
ODE, EDO = "<friction><ode>", "</ode></friction>"
UNIT = "<ixx>1</ixx><iyy>1</iyy><izz>1</izz>"

unhurried = settings(deadline=None)


def world(content: str) -> tuple[Body, ...]:
    text = f'<sdf version="1.9"><world name="w">{content}</world></sdf>'
    return read_sdf(text.encode(), "w.sdf").bodies


@pytest.fixture(autouse=True)
def level_of_terminals(caplog: Log) -> None:
    """Details are for the log of a run alone."""
    caplog.set_level(logging.INFO, "evoros")


# ---- Ignored and reported elements.


def test_what_cannot_matter_is_left_out_quietly(caplog: Log) -> None:
    with caplog.at_level(logging.DEBUG):
        (body,) = world(
            "<gui/><scene/><light name='sun' type='directional'/><gravity>0 0 -9.8</gravity>"
            "<physics type='ode'><max_step_size>1</max_step_size></physics>"
            f"<model name='m'>{STATIC}<self_collide>0</self_collide><link name='l'>"
            "<visual name='v'><geometry><mesh/></geometry></visual>"
            "<velocity_decay><linear>0</linear></velocity_decay>"
            f"<collision name='c'>{BOX}<max_contacts>10</max_contacts>"
            "<surface><contact><ode/></contact><bounce/><friction><ode/><torsional><ode/></torsional></friction></surface>"
            "</collision></link></model>"
        )
    assert body.friction == 1.0
    assert not caplog.records


@pytest.mark.parametrize(
    ("element", "where"),
    [
        ("<plugin name='p' filename='f'/>", "world"),
        ("<velocity_decay><linear>0.1</linear></velocity_decay>", "link"),
        ("<surface><bounce><threshold>1</threshold></bounce></surface>", "collision"),
        (f"<surface>{ODE}<mu>1</mu><mu2>0.5</mu2>{EDO}</surface>", "collision"),
        (f"<surface>{ODE}<slip1>0.5</slip1>{EDO}</surface>", "collision"),
        ("<state><model name='nobody'><pose>0 0 0 0 0 0</pose></model></state>", "world"),
        ("<gz:thing xmlns:gz='x'>1</gz:thing>", "link"),
    ],
)  # fmt: skip
def test_what_no_engine_has_is_reported_by_name_and_line(
    element: str, where: str, caplog: Log
) -> None:
    with caplog.at_level(logging.WARNING, "evoros.sdf"):
        (body,) = world(put(element, where))
    (record,) = caplog.records
    assert record.name == "evoros.sdf"
    assert record.getMessage().startswith("w.sdf:3: <")
    assert body.shapes[0].size == (1.0, 2.0, 3.0)


TOLD = [
    # What is left out.
    ("<actor name='a'/>", "world", "stands still, because the actor has fewer than two waypoints"),
    ("<road name='r'/>", "world", "paint"),
    ("<population name='p'/>", "world", "left out"),
    ("<plugin name='p' filename='libmove.so'/>", "model", "libmove.so is ignored"),
    ("<surprise/>", "link", "not part of <link>"),
    ("<image><uri>walls.png</uri></image>", "geometry", "left out"),
    # What is assumed.
    ("<box/>", "geometry", "1 1 1 m is assumed"),
    ("<cylinder><radius>1</radius></cylinder>", "geometry", "<length>: SDF's default of 1 m"),
    ("<inertial><mass>0</mass></inertial>", "link", "1 kg is assumed"),
    ("<inertial><mass>-5</mass></inertial>", "link", "1 kg is assumed"),
    ("<inertial><inertia><ixx>1</ixx><iyy>1</iyy></inertia></inertial>", "link", "no izz"),
    ("<inertial><inertia><ixx>1</ixx><iyy>1</iyy><ixx/></inertia></inertial>", "link", "no izz"),
    (f"<inertial><inertia>{UNIT}<ixy>2</ixy></inertia></inertial>", "link", "positive definite"),
    ("<frame name='f'><pose>0 0 0 0 0 90</pose></frame>", "model", "0 0 90 rad, more than a full"),
    ("<link name='l'/>", "model", "'l_0'"),
    ("<model name='m'/>", "world", "'m_0'"),
    ("<collision name='c'><geometry><empty/></geometry></collision>", "link", "'c_0'"),
    ("<state><model name='m'><scale>2 1 1</scale></model></state>", "world", "scales"),
]  # fmt: skip


@pytest.mark.parametrize(("element", "where", "says"), TOLD)
def test_what_is_left_out_or_assumed_is_told_in_one_line(
    element: str, where: str, says: str, caplog: Log
) -> None:
    with caplog.at_level(logging.WARNING, "evoros.sdf"):
        world(put(element, where).replace(STATIC, "" if "inertia" in element else STATIC))
    messages = [message for message in caplog.messages if "has no mass" not in message]
    assert len(messages) == 1
    assert says in messages[0]
    assert messages[0].startswith(("w.sdf:3: <", "w.sdf:4: <"))


def test_a_plugin_that_may_matter_is_not_hidden_by_others(caplog: Log) -> None:
    names = ("gz-sim-physics-system", "gz-sim-sensors-system", "libconveyor.so", "libdoor.so")
    plugins = "\n".join(f"<plugin filename='{name}' name='x'/>" for name in names)
    world(f"{plugins}<model name='m'>{STATIC}{LINK}</model>")
    assert len(caplog.messages) == 2  # of those that move nothing, and of the others
    assert sum("libconveyor.so" in message for message in caplog.messages) == 1
    assert sum("libdoor.so" in message for message in caplog.messages) == 1
    assert sum("physics" in m and "sensors" in m for m in caplog.messages) == 1
    assert not any("physics" in m and "libdoor" in m for m in caplog.messages)


def test_what_is_left_out_many_times_is_reported_once(caplog: Log) -> None:
    surface = "<surface><bounce><threshold>1</threshold></bounce></surface>"
    link = LINK.replace("</collision>", f"{surface}</collision>")
    world("\n".join(f"<model name='m{i}'>{STATIC}{link}</model>" for i in range(9)))
    (message,) = caplog.messages
    assert message.startswith("w.sdf:1: <bounce> of collision 'c' of link 'l' of model 'm0'")
    assert "8 more" in message


def test_a_link_that_has_no_mass_or_no_collision_is_reported(caplog: Log) -> None:
    (body,) = world(f"<model name='m'>{LINK}\n<link name='ghost'>{MASS}</link></model>")
    assert (body.name, body.mass) == ("m::l", 1.0)
    no_mass, no_collision = caplog.messages
    assert no_mass.startswith("w.sdf:1: <link> of link 'l'")
    assert no_collision.startswith("w.sdf:2: <link> of link 'ghost'")


# ---- Refused elements.


def put(element: str, where: str) -> str:
    """A world that is sound but for one element, on line 3."""
    parts = dict.fromkeys(("world", "model", "link", "collision", "geometry"), "")
    parts[where] = f"\n\n{element}\n"
    geometry = parts["geometry"] or "<box><size>1 2 3</size></box>"
    return (
        f"{parts['world']}<model name='m'>{STATIC}{parts['model']}<link name='l'>{parts['link']}"
        f"<collision name='c'>{parts['collision']}<geometry>{geometry}</geometry></collision>"
        "</link></model>"
    )


UNUSABLE = [
    # What would change what stands where, or how it moves.
    ("<include><uri>model://house</uri></include>", "world", "include"),
    ("<include><uri>model://house</uri></include>", "model", "include"),
    ("<physics><gravity>0 0 0</gravity></physics>", "world", "gravity"),
    ("<gravity>0 2 -9.8</gravity>", "world", "point straight down"),
    ("<model name='m2' placement_frame='l'/>", "model", "'l'"),
    ("<model name='m2' placement_frame='k'><link name='k'><pose relative_to='m::l'/></link>"
     "</model>", "model", "'m::l'"),
    ("<torus/>", "geometry", "torus"),
    ("<mesh/>", "geometry", "<uri>"),
    ("<polyline><point>0 0</point><point>1 0</point></polyline>", "geometry", "three or more"),
    ("<polyline><point>0 0</point><point>1 1</point><point>1 0</point><point>0 1</point>"
     "</polyline>", "geometry", "simple polygon"),
    ("<cone><radius>0</radius></cone>", "geometry", "greater than 0"),
    ("<include/>", "world", "<uri>"),
    ("<xacro:wall xmlns:xacro='x'/>", "world", "xacro:wall"),
    ("<mesh><uri>house.dae</uri></mesh>", "geometry", "mesh"),
    ("<heightmap/>", "geometry", "<uri>"),
    ("<heightmap><uri>no.png</uri></heightmap>", "geometry", "no.png"),
    ("<polyline/>", "geometry", "three or more"),
    ("<box><size>1 1 1</size></box><sphere><radius>1</radius></sphere>", "geometry", "geometry"),
    # Numbers.
    ("<box><size/></box>", "geometry", "3 numbers"),
    ("<box><size>1 1</size></box>", "geometry", "3 numbers, not 2"),
    ("<box><size>1 1 1 1</size></box>", "geometry", "3 numbers, not 4"),
    ("<box><size>1 -1 1</size></box>", "geometry", "greater than 0"),
    ("<box><size>1 0 1</size></box>", "geometry", "greater than 0"),
    ("<box><size>1 nan 1</size></box>", "geometry", "'nan'"),
    ("<box><size>1 inf 1</size></box>", "geometry", "'inf'"),
    ("<box><size>1 1e400 1</size></box>", "geometry", "'1e400'"),
    ("<box><size>1 1_0 1</size></box>", "geometry", "'1_0'"),
    ("<box><size>1, 1, 1</size></box>", "geometry", "'1,'"),
    ("<box><size>1 \u0661 1</size></box>", "geometry", "numbers"),
    ("<box><size>1 ${x} 1</size></box>", "geometry", "'${x}'"),
    ("<box><size>1 1 1</size><size>2 2 2</size></box>", "geometry", "given 2 times"),
    ("<sphere><radius>-1</radius></sphere>", "geometry", "greater than 0"),
    ("<plane><normal>0 0 0</normal></plane>", "geometry", "0 0 1"),
    ("<pose>0 0 0 0 0</pose>", "link", "6 numbers, not 5"),
    ("<pose>0 0 0 0 0 0 1</pose>", "link", "6 numbers, not 7"),
    ("<pose>0 0 0 0 0 north</pose>", "link", "'north'"),
    ("<pose>0 0 0 0 0 <b/>0</pose>", "link", "<b>"),
    ("<pose rotation_format='quat_xyzw'>0 0 0 0 0 0 0</pose>", "link", "quaternion"),
    ("<pose rotation_format='matrix'>0 0 0 0 0 0</pose>", "link", "'matrix'"),
    ("<pose degrees='maybe'>0 0 0 0 0 0</pose>", "link", "'maybe'"),
    ("<pose/><pose/>", "link", "given 2 times"),
    ("<surface><friction><ode><mu>x</mu></ode></friction></surface>", "collision", "a number for"),
    ("<static>perhaps</static>", "model", "'perhaps'"),
    # Names.
    ("<pose relative_to='nowhere'>0 0 0 0 0 0</pose>", "model", "'nowhere'"),
    ("<pose relative_to='nowhere'>0 0 0 0 0 0</pose>", "collision", "'nowhere'"),
    ("<pose frame='nowhere'>0 0 0 0 0 0</pose>", "link", "'nowhere'"),
    ("<pose relative_to='l'>0 0 0 0 0 0</pose>", "link", "circular"),
    ("<model name='n'><pose relative_to='n::k'/><link name='k'/></model>", "model", "circular"),
    ("<frame name='a' attached_to='b'/><frame name='b' attached_to='a'/>"
     "<link name='k'><pose relative_to='a'/></link>", "model", "a -> m::b -> m::a"),
    ("<frame name='a' attached_to='a'/>", "model", "circular"),
    ("<frame name='a' attached_to='nowhere'/>", "world", "'nowhere'"),
    ("<frame name='l'/>", "model", "in use"),
    ("<link/>", "model", "must have a name"),
    ("<link name='world'/>", "model", "reserved"),
    ("<collision name='d'/>", "link", "geometry"),
]  # fmt: skip


@pytest.mark.parametrize(("element", "where", "says"), UNUSABLE)
def test_what_cannot_be_used_is_an_error_with_file_line_and_fix(
    element: str, where: str, says: str
) -> None:
    with pytest.raises(InputError) as caught:
        world(put(element, where))
    message = str(caught.value)
    # Of two with one name the later one is named, which here stands on the line after.
    line = 4 if says == "in use" else 3
    assert message.startswith(f"w.sdf:{line}: <"), message
    assert says in message
    assert "; " in message
    assert "\n" not in message


JOINTS = [
    ("<joint name='j' type='fixed'><parent>l</parent><child>nobody</child></joint>", "'nobody'"),
    ("<joint name='j' type='fixed'><parent>l</parent></joint>", "<child>"),
    ("<joint name='j' type='fixed'><parent>f</parent><child>k</child></joint>", "name a link"),
    ("<joint name='j'><parent>l</parent><child>k</child></joint>", "has the unknown type ''"),
]  # fmt: skip


@pytest.mark.parametrize(("element", "says"), JOINTS)
def test_a_joint_that_connects_nothing_is_an_error(element: str, says: str) -> None:
    two = f"{LINK}<link name='k'>{COLLISION}</link><frame name='f'/>"
    with pytest.raises(InputError, match=r"^w\.sdf:2: <") as caught:
        world(f"<model name='m'>{two}\n{element}</model>")
    assert says in str(caught.value)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "not well-formed"),
        ("<sdf version='1.9'>", "not well-formed"),
        ("<sdf version='1.9'><world name='w'></model></sdf>", "not well-formed"),
        ("<sdf version='1.9'>&nbsp;</sdf>", "not well-formed"),
        ("<robot name='r'/>", "must be <sdf>"),
        ("<gazebo version='0.9'/>", "1.0 to 1.12"),
        ("<sdf/>", "1.0 to 1.12"),
        ("<sdf version='1.13'/>", "1.0 to 1.12"),
        ("<sdf version='1.40'/>", "1.0 to 1.12"),
        ("<sdf version='2.0'/>", "1.0 to 1.12"),
        ("<sdf version='1.9'><world name='a'/><world name='b'/></sdf>", "one of: 'a', 'b'"),
        ("<!DOCTYPE sdf><sdf version='1.9'/>", "DOCTYPE"),
        ("<!DOCTYPE sdf SYSTEM 'http://127.0.0.1:9/x'><sdf version='1.9'/>", "DOCTYPE"),
        ("<!DOCTYPE sdf [<!ENTITY e SYSTEM 'file:///etc/hostname'>]><sdf>&e;</sdf>", "DOCTYPE"),
    ],
)
def test_only_one_plain_sdf_document_is_accepted(text: str, says: str) -> None:
    with pytest.raises(InputError) as caught:
        read_sdf(text.encode(), "a b%20ü.sdf")
    assert says in str(caught.value)
    assert str(caught.value).startswith("a b%20ü.sdf:1: ")
    assert "\n" not in str(caught.value)


def test_entities_do_not_grow() -> None:
    levels = "".join(f"<!ENTITY e{i} '{f'&e{i - 1};' * 10}'>" for i in range(1, 12))
    bomb = f"<!DOCTYPE sdf [<!ENTITY e0 'ha'>{levels}]><sdf version='1.9' a='&e11;'>&e11;</sdf>"
    for encoding in ("utf-8", "utf-16"):
        with pytest.raises(InputError):
            read_sdf(bomb.encode(encoding), "w.sdf")


def test_a_long_value_makes_no_long_message() -> None:
    with pytest.raises(InputError) as caught:
        world(put(f"<pose>0 0 0 0 0 {'x' * 100_000}</pose>", "link"))
    assert len(str(caught.value)) < 300


@unhurried
@given(st.binary(max_size=40), st.integers(0, 10_000), st.integers(0, 60))
def test_a_damaged_file_is_read_or_refused_in_one_line(junk: bytes, at: int, cut: int) -> None:
    body = put("<inertial><mass>1</mass></inertial>", "link")
    sound = f"<sdf version='1.9'><world name='w'>{body}</world></sdf>".encode()
    at %= len(sound)
    message = ""
    try:
        read_sdf(sound[:at] + junk + sound[at + cut :], "w.sdf")
    except InputError as error:
        message = str(error)
    assert message == "" or message.startswith("w.sdf:")
    assert len(message.splitlines()) <= 1


def test_links_that_are_only_visible_are_told_once(caplog: Log) -> None:
    """Gazebo's rendering sensors see them; a link without any shape is nothing."""
    seen = "<link name='{}'><visual name='v'><geometry><box/></geometry></visual></link>"
    fixed = f"<model name='wall'>{STATIC}{seen.format('a')}</model>"
    loose = f"<model name='ball'>{seen.format('b')}<link name='empty'/></model>"
    assert len(world(f"{fixed}{loose}<model name='box'>{STATIC}{LINK}</model>")) == 1
    (message,) = caplog.messages
    assert "'wall'" in message
    assert "without a <collision>, nothing can touch or see the model" in message
    assert "(and 1 more of this kind: 'ball')" in message
