"""Checks of a robot's wheels that all drives on wheels share."""

import logging
import math
from collections.abc import Sequence

import numpy as np

from evoros.base.arrays import Array
from evoros.base.checks import POSITIVE, Rule
from evoros.base.linear import product
from evoros.drive.protocol import Drive
from evoros.formats.strict_xml import list_names
from evoros.formats.urdf.parts import Joint
from evoros.formats.urdf.tree import Urdf
from evoros.geometry.footprint import bottom_height

_LOG = logging.getLogger(__name__)

TOLERANCE_M = 1e-3
"""How far wheels may be from lying opposite each other, or from touching the ground, untold."""

TOLERATED_M, TOLERATED_SHARE = 5e-3, 0.05
"""How far they may be at most: a distance [m] or a share of the wheels' radius."""

CASTER_GAP_M = 12e-3
"""How far above or below the ground the lowest point of a caster may be."""

FORWARD, LEFT, UP = range(3)

ANGLE = Rule(
    "an angle greater than 0 and less than pi/2", lambda v: POSITIVE.holds(v) and v < 0.5 * math.pi
)


def skids(drive: Drive) -> bool:
    """Return whether wheels slip sideways in a turn: more than two, none of which is steered."""
    return not drive.steering_joints and len(drive.wheel_joints) > 2


def _names(minimum: int, maximum: float, text: str) -> Rule:
    return Rule(
        text,
        lambda v: (
            isinstance(v, list | tuple)
            and minimum <= len(v) <= maximum
            and all(isinstance(name, str) and name for name in v)
            and len(set(v)) == len(v)
        ),
    )


PAIR = _names(2, 2, "a list of the names of two joints, left and right")
SIDE = _names(2, math.inf, "a list of the names of two or more joints")
LINKS = _names(0, math.inf, "a list of the names of links")


def tolerated(radius: float) -> float:
    """How far [m] a wheel of a radius [m] may be from where it should be."""
    return max(TOLERATED_M, TOLERATED_SHARE * radius)


def tell_offset(urdf: Urdf, offset: float, what: str) -> None:
    """Report an offset [m] that is taken although it is more than rounding."""
    if abs(offset) > TOLERANCE_M:
        _LOG.warning("%s: %s by %.1f mm, which is taken as it is", urdf.source, what, 1e3 * offset)


def driven_joint(urdf: Urdf, name: str, kind: str, axis: int) -> Joint:
    """A joint that can be driven, about the robot's axis FORWARD, LEFT or UP."""
    joint = urdf.find_joint(name, kind)
    if joint.effort <= 0:
        fix = 'give it <limit effort="..." velocity="..."/>'
        raise urdf.error(f"joint {name!r} must have an effort above 0", fix)
    if urdf.axis_of(joint)[axis] < 1.0 - 1e-6:
        direction = ("forward (x)", "to the left (y)", "up (z)")[axis]
        fix = "turn its <axis> or its <origin>"
        raise urdf.error(f"joint {name!r} must have its axis point {direction}", fix)
    return joint


def wheel(urdf: Urdf, name: str) -> tuple[Array, float]:
    """Centre (3,) [m] in the robot's frame and radius [m] of the wheel on a joint."""
    link = driven_joint(urdf, name, "continuous", LEFT).child
    shapes = urdf.shapes[link]
    if len(shapes) != 1 or shapes[0].kind not in ("cylinder", "sphere"):
        rule = f"wheel {link!r} must have one collision shape, a cylinder or a sphere"
        raise urdf.error(rule, "give it such a <collision>")
    pose, radius = urdf.poses[link] @ shapes[0].pose, shapes[0].size[0]
    if shapes[0].kind == "cylinder" and abs(pose.rotation[LEFT, 2]) < 1.0 - 1e-6:
        fix = 'turn its <origin>, for example by rpy="1.5707963 0 0"'
        raise urdf.error(f"wheel {link!r} must have the cylinder's axis along its own", fix)
    axle, center = urdf.poses[link].position, pose.position
    if abs(center[0] - axle[0]) + abs(center[2] - axle[2]) > tolerated(radius):
        raise urdf.error(f"wheel {link!r} must be centred on its joint", "correct its <origin>")
    if abs(center[2] - radius) > tolerated(radius):
        rule = f"wheel {link!r} must touch the ground, which is at the height 0 of {urdf.root!r}"
        heights = f"its centre is at {center[2]:g} m, its radius {radius:g} m"
        raise urdf.error(f"{rule}, but {heights}", "correct the <origin> of its joints")
    tell_offset(urdf, center[2] - radius, f"wheel {link!r} is above the ground")
    return product(urdf.poses[link].rotation, np.array(shapes[0].pose.position)) + axle, radius


def axle(
    urdf: Urdf, names: Sequence[str], places: Sequence[Array], radius: float
) -> tuple[float, float]:
    """x [m] and track [m] of two places, left then right, which must lie opposite each other.

    Raises:
        InputError: they do not. It has the ``names`` of their joints; the ``radius`` [m] of the
            wheels sets the tolerance.
    """
    (left_x, left_y, _), (right_x, right_y, _) = (place.tolist() for place in places)
    if left_y <= right_y:
        raise urdf.error(f"joint {names[0]!r} must be left of {names[1]!r}", "swap the two names")
    offset = max(abs(left_x - right_x), abs(left_y + right_y))
    if offset > tolerated(radius):
        places_m = f"({left_x:g}, {left_y:g}) and ({right_x:g}, {right_y:g})"
        rule = f"joints {names[0]!r} and {names[1]!r} must lie opposite each other"
        raise urdf.error(f"{rule}, not at {places_m}", "correct their <origin>")
    tell_offset(urdf, offset, f"joints {names[0]!r} and {names[1]!r} are not opposite")
    return 0.5 * (left_x + right_x), left_y - right_y


def same_radius(urdf: Urdf, radii: Sequence[float]) -> float:
    """The radius [m] of all wheels."""
    radius = math.fsum(radii) / len(radii)
    if max(radii) - min(radii) > tolerated(radius):
        sizes = ", ".join(f"{radius:g}" for radius in radii)
        raise urdf.error(f"wheels must be equally large, not {sizes} m", "correct their shapes")
    tell_offset(urdf, max(radii) - min(radii), "the radii of the wheels differ")
    return radius


def check_caster(urdf: Urdf, link: str, wheels: Sequence[str]) -> None:
    """Check that a caster has a shape, whose lowest point is on the ground."""
    if link in {urdf.joints[name].child for name in wheels}:
        raise urdf.error(f"caster {link!r} must not be a driven wheel", "name another link")
    if link not in urdf.poses:
        known = list_names(sorted(urdf.poses))
        raise urdf.error(f"caster link {link!r} must exist", f"name one of: {known}")
    shapes, pose = urdf.shapes[link], urdf.poses[link]
    if not shapes or link == urdf.root:
        rule = f"caster {link!r} must be a link of its own with a collision shape"
        raise urdf.error(rule, "give it a <link> with a sphere for <collision>")
    height = min(bottom_height(shape, pose @ shape.pose) for shape in shapes)
    if abs(height) > CASTER_GAP_M:
        rule = f"caster {link!r} must touch the ground, which is at the height 0 of {urdf.root!r}"
        fix = "correct the <origin> of its joint"
        raise urdf.error(f"{rule}, but its lowest point is at {height:g} m", fix)
