"""Parts of a description that can be omitted if their packages are missing or ignored."""

import logging
import re
from collections.abc import Sequence

from lxml.etree import _Element as Element

from evoros.formats.lenient_xml import parse_leniently
from evoros.formats.urdf.xacro_packages import IGNORED

_LOG = logging.getLogger(__name__)
_SENSOR = re.compile(
    r"camera|lidar|laser|velodyne|ouster|livox|hokuyo|realsense|kinect|orbbec|openni|depthai|sonar|"
    r"sensor|(?<![a-z])(urg|sick|lms|zed|oak|imu|gps|gnss)",
    re.IGNORECASE,
)
_DECORATION = frozenset(("visual", "material", "gazebo", "transmission", "ros2_control"))
"""Elements without effect on mass, shape or motion."""


def is_needed(text: str, absent: Sequence[str], calls: Sequence[str]) -> bool:
    """Return True if an expanded description requires the missing packages.

    Decorations do not. If the description calls macros of missing packages, all these packages or
    all these macros must have sensor names, because designs replace sensors.
    """
    if calls and not any(all(map(_SENSOR.search, names)) for names in (absent, calls)):
        return True
    root = parse_leniently(text.encode(), "")
    links = set(root.xpath("link/@name"))
    ends = root.xpath("joint/parent/@link | joint/child/@link")
    return not links or not links.issuperset(ends) or any(map(_names_absent, root))


def names_sensor(link: Element) -> bool:
    """Return True if the name of a link is a sensor name."""
    return bool(_SENSOR.search(str(link.get("name"))))


def _names_absent(element: Element) -> bool:
    """Return True if an element, unless a decoration, names a file of a missing package."""
    if element.tag in _DECORATION:
        return False
    words = (element.text or "", *map(str, element.attrib.values()))
    return any(IGNORED in word for word in words) or any(map(_names_absent, element))


def leave_out_loose(root: Element, source: str) -> None:
    """Remove joints to links that a ``<robot>`` lacks, and all parts connected only by these."""
    parents: dict[str, str] = {}
    names = dict.fromkeys(map(str, root.xpath("link/@name")))
    loose: list[str] = []
    for joint in root.findall("joint"):
        ends = [str((joint.xpath(f"{tag}/@link") or [""])[0]) for tag in ("parent", "child")]
        if not set(ends) <= names.keys():
            root.remove(joint)
            loose.append(str(joint.get("name")))
        else:
            parents[ends[1]] = ends[0]
    if not loose:
        return
    trees: dict[str, list[str]] = {}
    for name in names:
        top = name
        for _ in names:
            top = parents.get(top, top)
        trees.setdefault(top, []).append(name)
    kept = max(trees.values(), key=len)
    for element in root.findall("link"):
        if element.get("name") not in kept:
            root.remove(element)
            loose.append(str(element.get("name")))
    for joint in root.findall("joint"):
        if not set(joint.xpath("child/@link")) <= {*kept}:
            root.remove(joint)
    text = "%s: links that depend on ignored packages are left out: %s"
    _LOG.warning(text, source, ", ".join(loose))
