"""SDF 1.0, whose attributes became elements, and XML that is clear though not well-formed."""

import contextlib
import logging
from collections.abc import Mapping

import pytest
from fixture_types import Log
from hypothesis import given, settings
from hypothesis import strategies as st
from sdf_cases import unhurried, world

from evoros.base.errors import InputError
from evoros.formats.lenient_xml import parse_leniently
from evoros.formats.sdf.reader import SdfWorld, read_sdf
from evoros.geometry.shapes import Body

SLIPS = [
    ("<!-- made by hand -->\n<?xml version='1.0'?>\n<sdf>\n<a/></sdf>", "declaration"),
    ("\n\n<?xml version='1.0' ?>\n<sdf><a/></sdf>", "declaration"),
    ("\ufeff<!-- x -->\n\n<?xml version='1.0' encoding='utf-8'?><sdf>\n<a/></sdf>", "declaration"),
    ("<?xml version='1.0'?>\n<!-- a -- b --->\n<sdf>\n<a/></sdf>", "-- in a comment"),
    ("<sdf>\n<!--- wall\n---- roof -->\n<a/></sdf>", "-- in a comment"),
    ("<sdf>\n\n<gz:b ignition:c='1'>x</gz:b><a/></sdf>", "gz:, ignition:"),
    ("<sdf>\n<gz::priority>1</gz::priority>\n<a/></sdf>", ":: in an element name"),
    ("<sdf>\n\n<b name='R&D'>1 & 2 &lt; 3</b><a/></sdf>", "&amp;"),
    ("<sdf>\n<pose frame=>1 2</pose>\n<a/></sdf>", "without quotes"),
    ("<sdf>\n<b c = 1 d='x=y>' e\n=\n2 f/>\n<a/></sdf>", "without quotes"),
    ("<sdf>\n<a/><sdf/><sdf>x</sdf></sdf>\n<sdf><b></sdf>", "after the root"),
    ("<sdf>\n<a/></sdf>\ngood night", "after the root"),
    ("<?xml version='1.0' encoding='latin-1'?>\n<sdf>\n<b>\u00e9 & x</b><a/></sdf>", "&amp;"),
]


@pytest.mark.parametrize(("text", "slip"), SLIPS)
def test_a_clear_slip_is_repaired_told_and_moves_no_line(text: str, slip: str, caplog: Log) -> None:
    with caplog.at_level(logging.WARNING):
        root = parse_leniently(text.encode("latin-1" if "latin-1" in text else "utf-8"), "w.sdf")
    element = root.find("a")
    assert element is not None
    assert element.sourceline == text[: text.index("<a/>")].count("\n") + 1
    (message,) = caplog.messages
    assert message.startswith("w.sdf: ")
    assert slip in message


def test_repaired_text_is_unchanged() -> None:
    root = parse_leniently("<s><b n='R&D'>é & <![CDATA[<!-- x -->]]></b></s>".encode(), "w.sdf")
    assert (root[0].get("n"), root[0].text) == ("R&D", "é & <!-- x -->")


def test_values_without_quotes_end_where_tinyxml_ends_them() -> None:
    text = "<s><b c=1.5 d= x e='f=g' h= i/><![CDATA[<b c=1>]]></s>"
    (element,) = parse_leniently(text.encode(), "w.sdf")
    assert dict(element.attrib) == {"c": "1.5", "d": "x", "e": "f=g", "h": "i"}
    assert element.tail == "<b c=1>"


@given(st.text(alphabet="<>/=\"' \nab:!-&[]", max_size=60))
@settings(deadline=None)
def test_any_text_is_read_or_an_input_error(text: str) -> None:
    with contextlib.suppress(InputError):
        parse_leniently(f"<s>{text}</s>".encode(), "w.sdf")


@pytest.mark.parametrize(
    "text",
    [
        "<sdf>",
        "<sdf></a>",
        "x -- y",
        "<!DOCTYPE sdf><gz:a/>",
        "<sdf>&nbsp;</sdf>",
        "<!-- -- -->",
        "<a b='1' b='2'/>",
    ],
)
def test_what_is_not_clear_stays_an_error(text: str) -> None:
    with pytest.raises(InputError, match=r"^w\.sdf:1: "):
        parse_leniently(text.encode(), "w.sdf")


def test_a_sound_document_is_read_in_silence(caplog: Log) -> None:
    assert parse_leniently(b"<?xml version='1.0'?><!-- x --><sdf/>", "w.sdf").tag == "sdf"
    assert not caplog.records


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
    assert any("attributes read as elements: 8" in message for message in caplog.messages)


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
