"""Poses of SDF, which robots written for Gazebo use as well."""

import math

from lxml.etree import _Element as Element

from evoros.formats.strict_xml import element_error, quote, read_flag_attribute, read_numbers
from evoros.geometry.shapes import Pose, normalize


def parse_pose(element: Element) -> Pose:
    """Read the content of a ``<pose>``; an empty one is the identity."""
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
