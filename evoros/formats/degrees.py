"""Notes angles that are too large for radians, as of authors who wrote degrees."""

import logging
import math

from lxml.etree import _Element as Element

from evoros.formats.notes import Notes
from evoros.formats.strict_xml import walk_up

LARGEST_RAD = 2.0 * math.pi + 0.01
"""A full turn, rounded as people round it; nobody writes more in radians."""
_LOOKS = ("gui", "light", "scene", "plugin")  # whose poses nothing here needs


def note_degrees(root: Element, notes: Notes) -> None:
    """Note each ``<origin>`` of URDF and ``<pose>`` of SDF that turns by more than a full turn."""
    for element in root.iter("origin", "pose"):
        words = _list_angles(element)
        if exceeds_turn(words) and not any(owner.tag in _LOOKS for owner in walk_up(element)):
            problem = (
                f"turns by {' '.join(words)} rad, more than a full turn, as if they were degrees; "
                f"write radians"
            )
            notes.add(element, problem, "degrees")


def tell_degrees(root: Element, log: logging.Logger) -> None:
    """Log what ``note_degrees`` notes."""
    notes = Notes(log)
    note_degrees(root, notes)
    notes.report()


def exceeds_turn(words: list[str]) -> bool:
    """Return whether one of the numbers is more than a full turn [rad]; others are no numbers."""
    try:
        return any(LARGEST_RAD < abs(float(word)) < math.inf for word in words)
    except ValueError:
        return False


def _list_angles(element: Element) -> list[str]:
    """Return the words of roll, pitch and yaw [rad]; none if they are in degrees."""
    if element.tag == "origin":
        return str(element.get("rpy", "")).split()
    if element.get("degrees", "").strip() in ("true", "1") or element.get("rotation_format"):
        return []
    return (element.text or "").split()[3:6]
