"""Reads XML strictly; errors name the file, line and element of anything not understood.

``MEANINGS`` lists numbers with a special meaning, such as no limit, from SDFormat 1.12 (up to 1.5,
the defaults of limits are -1 and +-1e16), ``JointAxis.cc`` and ``parser_urdf.cc`` of sdformat, and
``SurfaceParams.cc`` and ``Sensor.cc`` of Gazebo Classic.
"""

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import NamedTuple

from lxml import etree
from lxml.etree import _Element as Element

from evoros.base.errors import InputError, escape
from evoros.geometry.shapes import Pose, normalize

SOURCE = "{evoros}source"  # attribute that names the file of an element
_NUMBER = re.compile(r"[+-]?(([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?|[iI][nN][fF])")
_DEFAULT_NAMESPACE = re.compile(rb"\sxmlns\s*=")
_PLACE = re.compile(r", line \d+, column \d+( \(.*\))?$")
MAX_NUMBER = 1e9  # maximum length, mass or angle, which prevents overflow of products
_MAX_QUOTED = 60  # maximum length of a quoted value [characters]
_MAX_NAMES = 1000  # maximum length of a list of names [characters]
_MAX_REASON = 200  # maximum length of another library's reason [characters]


def parse(content: bytes, source: str) -> Element:
    """Parse a document and return its root, without comments and processing instructions.

    The default namespace is dropped, and no other file is read. ``source`` names the file in
    errors.
    """
    parser = etree.XMLParser(
        resolve_entities=False,
        no_network=True,
        load_dtd=False,
        remove_comments=True,
        remove_pis=True,
        huge_tree=False,
    )
    try:
        root = etree.fromstring(content, parser, base_url=escape(source))
    except (etree.XMLSyntaxError, ValueError) as error:
        line = getattr(error, "lineno", None) or 1
        reason = _PLACE.sub("", " ".join(str(error).split()))  # the message starts with a location
        problem = f"not well-formed XML: {shorten(reason)}"
        raise InputError(f"{source}:{line}: {problem}; edit that line") from None
    if root.getroottree().docinfo.doctype:
        # A DOCTYPE can define entities, which can read files and grow without bound.
        line = content[: content.find(b"<!DOCTYPE") + 1].count(b"\n") + 1
        raise InputError(f"{source}:{line}: a DOCTYPE is not accepted; delete it")
    if _DEFAULT_NAMESPACE.search(content):  # ROS and Gazebo ignore default namespaces
        for element in root.iter(etree.Element):
            if element.prefix is None:
                element.tag = etree.QName(element).localname
        etree.cleanup_namespaces(root, keep_ns_prefixes=[name for name in root.nsmap if name])
    return root


def element_error(element: Element, problem: str, fix: str) -> InputError:
    """Return an error about an element; ``problem`` is the predicate of its sentence."""
    return InputError(f"{locate(element)} {problem}; {fix}")


def walk_up(element: Element) -> Iterator[Element]:
    """Yield an element and its ancestors, up to the root."""
    yield element
    yield from element.iterancestors()


def source_of(element: Element) -> str:
    """Return the name of the file from which an element was read."""
    sources = (owner.get(SOURCE) for owner in walk_up(element))
    return str(next(filter(None, sources), element.getroottree().docinfo.URL))


def locate(element: Element) -> str:
    """Return the file, line and tag of an element, with the names of enclosing elements."""
    owners = [
        f" of {local_tag(owner)} {quote(owner.get('name', ''))}"
        for owner in walk_up(element)
        if owner.get("name") is not None
    ]
    return f"{place_of(element)}: <{local_tag(element)}>{''.join(owners)}"


def place_of(element: Element) -> str:
    """Return the file and line of an element."""
    return f"{source_of(element)}:{element.sourceline}"


def name_of(element: Element) -> str:
    """Return the quoted name of the nearest enclosing model or, without one, of the element."""
    owners = [owner for owner in walk_up(element) if owner.get("name")]
    models = [owner for owner in owners if owner.tag == "model"]
    return quote(next((str(owner.get("name")) for owner in (*models, *owners)), ""))


def local_tag(element: Element) -> str:
    """Return the tag of an element as written, including its prefix."""
    name = etree.QName(element).localname
    return f"{element.prefix}:{name}" if element.prefix else name


def shorten(reason: object, length: int = _MAX_REASON) -> str:
    """Return another library's reason for rejecting a file, shortened for a message."""
    text = str(reason)
    return text if len(text) <= length else f"{text[:length]}..."


def quote(text: str) -> str:
    """Return a quoted value on one line, shortened for a message."""
    return repr(text if len(text) <= _MAX_QUOTED else text[: _MAX_QUOTED - 3] + "...")


def list_names(names: Iterable[str]) -> str:
    """Return a list of names for a message, shortened if too long."""
    return shorten(", ".join(names) or "none", _MAX_NAMES)


def find_child(element: Element, tag: str) -> Element | None:
    """Return the only child with this tag, or None."""
    children = element.findall(tag)
    if len(children) > 1:
        problem = f"is given {len(children)} times in <{local_tag(element)}>"
        raise element_error(children[1], problem, "keep one of them")
    return children[0] if children else None


def require_child(element: Element, tag: str) -> Element:
    """Return the only child with this tag."""
    child = find_child(element, tag)
    if child is None:
        raise element_error(element, f"must have a <{tag}>", f"add a <{tag}>")
    return child


def read_text(element: Element) -> str:
    """Return the text content of an element without children."""
    if len(element):
        problem = f"must not be inside <{local_tag(element)}>, which contains only text"
        raise element_error(element[0], problem, "delete it")
    return (element.text or "").strip()


def read_name(element: Element) -> str:
    """Return the attribute ``name``, which must not be empty."""
    name = element.get("name", "").strip()
    if not name:
        raise element_error(element, "must have a name", 'add the attribute name="..."')
    return name


def parse_number(word: str) -> float:
    """Return the number in a word as read by ROS and Gazebo (ASCII, without ``_``), or NaN."""
    return float(word) if _NUMBER.fullmatch(word) else math.nan


def read_numbers(element: Element, *counts: int) -> tuple[float, ...]:
    """Return the numbers in an element; their count must be one of ``counts``."""
    words = read_text(element).split()
    if len(words) not in counts:
        expected = f"{' or '.join(map(str, counts))} number{'' if counts == (1,) else 's'}"
        problem = f"must have {expected}, not {len(words)}: {quote(read_text(element))}"
        raise element_error(element, problem, f"write {expected}")
    values = tuple(map(parse_number, words))
    for word, value in zip(words, values, strict=True):
        if not abs(value) <= MAX_NUMBER:
            limits = f"-{MAX_NUMBER:g} to {MAX_NUMBER:g}"
            problem = f"must contain only numbers from {limits}, not {quote(word)}"
            raise element_error(element, problem, "write a number in this range")
    return values


def read_number(element: Element, rule: str, holds: Callable[[float], bool]) -> float:
    """Return the only number in an element; ``rule`` completes "must be ..."."""
    (value,) = read_numbers(element, 1)
    if not holds(value):
        raise element_error(element, f"must be {rule}, not {value:g}", "correct the value")
    return value


def read_positive(element: Element, *counts: int) -> tuple[float, ...]:
    """Return the positive numbers in an element."""
    values = read_numbers(element, *counts)
    if min(values) <= 0:
        problem = f"must be greater than 0, not {' '.join(f'{value:g}' for value in values)}"
        raise element_error(element, problem, "write positive numbers only")
    return values


def read_child_numbers(element: Element, tag: str, default: tuple[float, ...]) -> tuple[float, ...]:
    """Return the numbers in the only ``tag`` child, as many as in ``default``, or ``default``."""
    child = find_child(element, tag)
    return default if child is None else read_numbers(child, len(default))


def read_flag(element: Element) -> bool:
    """Return a flag written as true, false, 1 or 0."""
    return _parse_flag(element, read_text(element), "must be")


def is_set(element: Element, attribute: str) -> bool:
    """Return True if an attribute is true; Gazebo treats invalid values as false."""
    return element.get(attribute, "").strip().lower() in ("true", "1")


def read_flag_attribute(element: Element, attribute: str) -> bool:
    """Return an attribute that must be true or false; false if absent."""
    return _parse_flag(element, element.get(attribute, "false"), f"must have {attribute}")


def _parse_flag(element: Element, text: str, subject: str) -> bool:
    word = text.strip().lower()
    if word not in ("true", "false", "1", "0"):
        problem = f"{subject} true or false, not {quote(word)}"
        raise element_error(element, problem, "write true or false")
    return word in ("true", "1")


HUGE = 1e9  # magnitude that means infinity, larger than any limit, range or friction


class Meaning(NamedTuple):
    """The meaning of a negative number or of 0 in a field; None for the literal value."""

    negative: float | None = None
    zero: float | None = None


MEANINGS: Mapping[str, Meaning] = {
    # URDF requires effort and velocity, so exporters write -1 or 0 if unknown.
    "limit/effort": Meaning(negative=math.inf, zero=math.inf),
    "limit/velocity": Meaning(negative=math.inf, zero=math.inf),
    "limit/lower": Meaning(),
    "limit/upper": Meaning(),
    "friction/mu": Meaning(negative=math.inf),
    "sensor/update_rate": Meaning(negative=math.inf, zero=math.inf),  # measured in every step
    "range/max": Meaning(),
}
"""Meanings of special numbers by field, named as in URDF and SDF; ``HUGE`` is always infinite."""


def interpret(field: str, value: float) -> float:
    """Return the meaning of a field's value by ``MEANINGS``; infinity means no limit."""
    meaning = MEANINGS[field]
    if abs(value) >= HUGE:
        value = math.copysign(math.inf, value)
    stands_for = meaning.negative if value < 0.0 else meaning.zero if value == 0.0 else None
    return value if stands_for is None else stands_for


def read_meaning(element: Element, field: str, text: str | None = None) -> float:
    """Return the meaning of the number in an element's content or in one of its attributes."""
    text = read_text(element) if text is None else text
    value = parse_number(text.strip())
    if math.isnan(value):
        problem = f"must have a number for {field.rpartition('/')[2]}, not {quote(text)}"
        raise element_error(element, problem, "write a number")
    return interpret(field, value)


def touches_nothing(collision: Element) -> bool:
    """Return True if nothing can collide with a ``<collision>``.

    This is so if it allows no contacts, if its mask contains none of the 16 bits of other
    collisions, or if it has no mask and sets ``collide_without_contact``.
    """
    contacts, contact = collision.findtext("max_contacts"), collision.find("surface/contact")
    if contacts is not None and _read_bits(contacts) == 0:
        return True
    if contact is None:
        return False
    masks = [contact.findtext(tag) for tag in ("collide_bitmask", "category_bitmask")]
    if masks[0] is None:
        flag = find_child(contact, "collide_without_contact")
        return flag is not None and read_flag(flag)
    return not any(_read_bits(mask) & 0xFFFF for mask in masks if mask is not None)


def _read_bits(text: str) -> int:
    """Return the integer in a string, or -1 (all bits set) if there is none."""
    try:
        return int(text.strip(), 0)
    except ValueError:
        return -1


def parse_pose(element: Element) -> Pose:
    """Read the content of a ``<pose>``; the identity if empty."""
    if not len(element) and not (element.text or "").strip():
        return Pose()
    form = element.get("rotation_format", "euler_rpy")
    degrees = read_flag_attribute(element, "degrees")
    if form == "quat_xyzw" and not degrees:
        x, y, z, *quaternion = read_numbers(element, 7)
        if sum(q * q for q in quaternion) < 1e-12:
            fix = "write 0 0 0 1 for no rotation"
            raise element_error(element, "has a quaternion of length 0", fix)
        return Pose((x, y, z), normalize(quaternion))
    if form != "euler_rpy":
        problem = f"has rotation_format {quote(form)}, degrees {str(degrees).lower()}"
        fix = 'use "euler_rpy", or "quat_xyzw" without degrees'
        raise element_error(element, problem, fix)
    x, y, z, *angles = read_numbers(element, 6)
    roll, pitch, yaw = (math.radians(a) if degrees else a for a in angles)
    return Pose.from_rpy((x, y, z), roll, pitch, yaw)
