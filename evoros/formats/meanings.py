"""Numbers of URDF and SDF with a special meaning, such as no limit or every step.

This is the only list of them, after SDFormat 1.12 (``joint.sdf``, ``surface.sdf``,
``collision.sdf``, ``sensor.sdf``, ``ray.sdf``; up to 1.5 the defaults of limits are -1 and +-1e16),
``JointAxis.cc`` and ``parser_urdf.cc`` of sdformat, and ``SurfaceParams.cc`` and ``Sensor.cc`` of
Gazebo Classic.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

from lxml.etree import _Element as Element

from evoros.formats.strict_xml import (
    element_error,
    find_child,
    parse_number,
    quote,
    read_flag,
    read_text,
)

HUGE = 1e9
"""Magnitude from which a number means "none"; no joint, range or friction coefficient is as
large."""


class Meaning(NamedTuple):
    """The meaning of a negative number or 0 in a field; None: the number itself."""

    negative: float | None = None
    zero: float | None = None


MEANINGS: Mapping[str, Meaning] = {
    # URDF requires effort and velocity, so exporters write -1 or 0 for unknown ones.
    "limit/effort": Meaning(negative=math.inf, zero=math.inf),
    "limit/velocity": Meaning(negative=math.inf, zero=math.inf),
    "limit/lower": Meaning(),
    "limit/upper": Meaning(),
    "friction/mu": Meaning(negative=math.inf),
    "sensor/update_rate": Meaning(negative=math.inf, zero=math.inf),  # measured at every step
    "range/max": Meaning(),
}
"""Fields by their names in both formats. In each, numbers from ``HUGE`` on are infinite."""


def interpret(field: str, value: float) -> float:
    """Return the number that a value of a field of ``MEANINGS`` means; inf: no limit."""
    meaning = MEANINGS[field]
    if abs(value) >= HUGE:
        value = math.copysign(math.inf, value)
    stands_for = meaning.negative if value < 0.0 else meaning.zero if value == 0.0 else None
    return value if stands_for is None else stands_for


def read_meaning(element: Element, field: str, text: str | None = None) -> float:
    """Return the meaning of a number in an element's content or in one of its attributes.

    Raises:
        InputError: the value is not a number.
    """
    text = read_text(element) if text is None else text
    value = parse_number(text.strip())
    if math.isnan(value):
        problem = f"must have a number for {field.rpartition('/')[2]}, not {quote(text)}"
        raise element_error(element, problem, "write a number")
    return interpret(field, value)


def touches_nothing(collision: Element) -> bool:
    """Return True if nothing collides with a ``<collision>``.

    It allows no contacts, has none of the 16 mask bits with which others collide, or has no mask
    and collides without contact. Other collisions have all bits set.
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
    """Return an integer, by default one with all bits set."""
    try:
        return int(text.strip(), 0)
    except ValueError:
        return -1
