"""XML that is not well-formed but clear, and XML that stays an error."""

import contextlib
import logging

import pytest
from fixture_types import Log
from hypothesis import given, settings
from hypothesis import strategies as st

from evoros.base.errors import InputError
from evoros.formats.lenient_xml import parse_leniently

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
