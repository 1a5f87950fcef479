"""What every drive on wheels needs to know of the wheels of its robot."""

import math
from collections.abc import Sequence

from evoros.base.arrays import Array
from evoros.base.checks import POSITIVE, Rule
from evoros.formats.urdf.parts import Joint
from evoros.formats.urdf.tree import Urdf

TOLERANCE_M = 1e-3
"""How far wheels may be from lying opposite each other, or from touching the ground."""

FORWARD, LEFT, UP = range(3)

ANGLE = Rule(
    "an angle greater than 0 and less than pi/2",
    lambda v: POSITIVE.holds(v) and v < 0.5 * math.pi,
)
PAIR = Rule(
    "a list of the names of two joints, left and right",
    lambda v: (
        isinstance(v, list | tuple)
        and len(v) == 2
        and all(isinstance(name, str) and name for name in v)
        and v[0] != v[1]
    ),
)


def driven_joint(urdf: Urdf, name: str, kind: str, axis: int) -> Joint:
    """A joint that can be driven, about the robot's axis FORWARD, LEFT or UP.

    Raises:
        InputError: it is missing, of another type, without effort, or about another axis.
    """
    joint = urdf.find_joint(name, kind)
    if joint.effort <= 0:
        cure = 'give it <limit effort="..." velocity="..."/>'
        raise urdf.error(f"joint {name!r} must have an effort above 0", cure)
    if urdf.axis_of(joint)[axis] < 1.0 - 1e-6:
        direction = ("forward (x)", "to the left (y)", "up (z)")[axis]
        cure = "turn its <axis> or its <origin>"
        raise urdf.error(f"joint {name!r} must have its axis point {direction}", cure)
    return joint


def wheel(urdf: Urdf, name: str) -> tuple[Array, float]:
    """Centre (3,) [m] in the robot's frame and radius [m] of the wheel on a joint.

    Raises:
        InputError: the joint cannot drive, or its link is not a wheel on the ground.
    """
    link = driven_joint(urdf, name, "continuous", LEFT).child
    shapes = urdf.shapes[link]
    if len(shapes) != 1 or shapes[0].kind not in ("cylinder", "sphere"):
        rule = f"wheel {link!r} must have one collision shape, a cylinder or a sphere"
        raise urdf.error(rule, "give it such a <collision>")
    pose, radius = urdf.poses[link] @ shapes[0].pose, shapes[0].size[0]
    if shapes[0].kind == "cylinder" and abs(pose.rotation[LEFT, 2]) < 1.0 - 1e-6:
        cure = 'turn its <origin>, for example by rpy="1.5707963 0 0"'
        raise urdf.error(f"wheel {link!r} must have the cylinder's axis along its own", cure)
    axle, center = urdf.poses[link].position, pose.position
    if abs(center[0] - axle[0]) + abs(center[2] - axle[2]) > TOLERANCE_M:
        raise urdf.error(f"wheel {link!r} must be centred on its joint", "correct its <origin>")
    if abs(center[2] - radius) > TOLERANCE_M:
        rule = f"wheel {link!r} must touch the ground, which is at the height 0 of {urdf.root!r}"
        found = f"its centre is at {center[2]:g} m, its radius {radius:g} m"
        raise urdf.error(f"{rule}, but {found}", "correct the <origin> of its joints")
    return urdf.poses[link].rotation @ shapes[0].pose.position + axle, radius


def axle(urdf: Urdf, names: Sequence[str], places: Sequence[Array]) -> tuple[float, float]:
    """x [m] and track [m] of two places, left then right, which must lie opposite each other.

    Raises:
        InputError: they do not; ``names`` are those of their joints.
    """
    (left_x, left_y, _), (right_x, right_y, _) = (place.tolist() for place in places)
    if left_y <= right_y:
        raise urdf.error(f"joint {names[0]!r} must be left of {names[1]!r}", "swap the two names")
    if abs(left_x - right_x) > TOLERANCE_M or abs(left_y + right_y) > TOLERANCE_M:
        found = f"({left_x:g}, {left_y:g}) and ({right_x:g}, {right_y:g})"
        rule = f"joints {names[0]!r} and {names[1]!r} must lie opposite each other, not at {found}"
        raise urdf.error(rule, "correct their <origin>")
    return 0.5 * (left_x + right_x), left_y - right_y


def same_radius(urdf: Urdf, radii: Sequence[float]) -> float:
    """The radius [m] of all wheels.

    Raises:
        InputError: they differ.
    """
    if max(radii) - min(radii) > TOLERANCE_M:
        found = ", ".join(f"{radius:g}" for radius in radii)
        raise urdf.error(f"wheels must be equally large, not {found} m", "correct their shapes")
    return math.fsum(radii) / len(radii)
