"""The base class of drives, checks of wheels and casters, and commands for joints."""

import logging
import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any, ClassVar, NamedTuple, Protocol, Self

import numpy as np

from evoros.base import elementary
from evoros.base.arrays import Array, product
from evoros.base.checks import POSITIVE, Rule
from evoros.drive.rolling import Pair
from evoros.formats.strict_xml import list_names
from evoros.formats.urdf.parts import Joint
from evoros.formats.urdf.tree import Urdf
from evoros.geometry.footprint import bottom_height


class Drive(Protocol):
    """A drive bound to a robot, for simulators and controllers."""

    @property
    def max_speed_mps(self) -> float:
        """The maximum speed [m/s] of the turning point ``rear_axle_x_m`` straight ahead."""

    @property
    def speed_limit_offset_m(self) -> float:
        """The lateral distance [m] from the turning point to the point that limits the speed.

        In a turn, the turning point moves at up to ``max_speed_mps / (1 + |curvature| *
        speed_limit_offset_m)``. If each of two wheels has a limit, the offset is half the track.
        """

    @property
    def steering_limit(self) -> float:
        """Full lock: the maximum steering angle [rad] of the bicycle model."""

    @property
    def wheelbase_m(self) -> float:
        """The wheelbase [m] of the bicycle model: curvature = tan(steering) / wheelbase."""

    @property
    def turn_ratio(self) -> float:
        """The ratio of actual to commanded curvature on level ground; 1 if no wheel slips."""

    @property
    def rear_axle_x_m(self) -> float:
        """x [m] of the turning point, which is on the unsteered axle unless its wheels slide."""

    @property
    def steering_joints(self) -> tuple[str, ...]:
        """The joints controlled by position."""

    @property
    def wheel_joints(self) -> tuple[str, ...]:
        """The joints controlled by velocity; their links touch only the ground.

        If ``speed_limit_offset_m`` is above 0, each side has a motor, and the first half of the
        joints is on the left.
        """

    @property
    def caster_links(self) -> tuple[str, ...]:
        """The links that slide on the ground without friction and touch nothing else."""

    def targets(self, speed: float, steering: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Return the angles [rad] of steering joints and the rates [rad/s] of wheel joints."""


class DriveDescription(ABC):
    """The joints that form a drive, and the limits of the drive."""

    steers: ClassVar[bool] = False  # True if some of the wheels are steered
    locks_steering: ClassVar[bool] = False
    """True if wheels on steering joints can form the drive once these are locked."""
    on_one_axle: ClassVar[bool] = False  # True if casters must keep the robot level
    steering_joints: Sequence[str]  # steering joints; empty if nothing steers
    wheel_joints: Sequence[str]  # joints of all driven wheels
    caster_links: Sequence[str]  # links that slide on the ground

    @classmethod
    def recognise(
        cls, steered: Sequence[Pair], others: Sequence[Pair], given: Mapping[str, Any]
    ) -> Self | None:
        """Return the drive that pairs of wheels form, or None (the default).

        The pairs in each list are ordered from front to rear. ``given`` holds the fields set by the
        user. No two drives in this folder recognise the same pairs.
        """
        return None

    @classmethod
    def build(cls, found: Mapping[str, Any], given: Mapping[str, Any]) -> Self:
        """Return a drive with the fields found on a robot, overridden by ``given``."""
        names = {field.name for field in fields(cls)}  # type: ignore[arg-type]
        return cls(**{**found, **{name: given[name] for name in names & given.keys()}})

    @abstractmethod
    def fit(self, urdf: Urdf) -> Drive:
        """Return the drive bound to a robot; raise an InputError for an unsuitable joint."""


_LOG = logging.getLogger(__name__)

TOLERANCE_M = 1e-3  # maximum deviation [m] of a wheel's position accepted without a warning
TOLERATED_M, TOLERATED_SHARE = 5e-3, 0.05  # maximum deviation of a wheel in metres, and in radii
TOLERATED_SKEW = 0.02  # maximum misalignment of the wheels on an axle, as a fraction of the track
CASTER_GAP_M = 12e-3  # maximum distance [m] between a caster's lowest point and the ground
FORWARD, LEFT, UP = range(3)
ANGLE = Rule(
    "an angle greater than 0 and less than pi/2", lambda v: POSITIVE.holds(v) and v < 0.5 * math.pi
)


def skids(drive: Drive) -> bool:
    """Return True if wheels slip sideways in turns: more than two, all unsteered."""
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


PAIR = _names(2, 2, "a list of two joint names, left and right")
SIDE = _names(2, math.inf, "a list of two or more joint names")
JOINTS = _names(0, math.inf, "a list of joint names")
LINKS = _names(0, math.inf, "a list of link names")


def tolerated(radius: float) -> float:
    """Return the maximum deviation [m] of the position of a wheel with a radius [m]."""
    return max(TOLERATED_M, TOLERATED_SHARE * radius)


def reach(radius: float) -> float:
    """Return the gap [m] up to which a wheel of a radius [m] counts as touching the ground."""
    return max(CASTER_GAP_M, 2.0 * tolerated(radius))


def tell_offset(urdf: Urdf, offset: float, what: str) -> None:
    """Warn about an offset [m] that exceeds rounding errors but is accepted."""
    if abs(offset) > TOLERANCE_M:
        _LOG.warning(
            "%s: %s by %.1f mm; evoros does not correct this", urdf.source, what, 1e3 * offset
        )


def driven_joint(urdf: Urdf, name: str, kind: str, axis: int) -> Joint:
    """Return a joint that can be driven about the axis FORWARD, LEFT or UP of the robot."""
    joint = urdf.find_joint(name, kind)
    if math.isinf(joint.effort):
        fix = 'add <limit effort="..." velocity="..."/>'
        raise urdf.error(f"joint {name!r} must have an effort limit above 0", fix)
    if urdf.axis_of(joint)[axis] < 1.0 - 1e-6:
        direction = ("forward (x)", "left (y)", "up (z)")[axis]
        fix = "rotate its <axis> or <origin>"
        raise urdf.error(f"the axis of joint {name!r} must point {direction}", fix)
    return joint


def wheel(urdf: Urdf, name: str) -> tuple[Array, float]:
    """Return the centre (3,) [m] in the robot's frame, and the radius [m], of a joint's wheel."""
    link = driven_joint(urdf, name, "continuous", LEFT).child
    shapes = urdf.shapes[link]
    if len(shapes) != 1 or shapes[0].kind not in ("cylinder", "sphere"):
        rule = f"wheel {link!r} must have one collision shape, a cylinder or a sphere"
        raise urdf.error(rule, "replace its <collision> elements with one of these")
    pose, radius = urdf.poses[link] @ shapes[0].pose, shapes[0].size[0]
    if shapes[0].kind == "cylinder" and abs(pose.rotation[LEFT, 2]) < 1.0 - 1e-6:
        fix = 'rotate the <origin> of its <collision>, for example with rpy="1.5707963 0 0"'
        raise urdf.error(f"the cylinder of wheel {link!r} must lie along the joint's axis", fix)
    axle, center = urdf.poses[link].position, pose.position
    if abs(center[0] - axle[0]) + abs(center[2] - axle[2]) > tolerated(radius):
        fix = "move the <origin> of its <collision> onto the joint's axis"
        raise urdf.error(f"wheel {link!r} must be centred on its joint", fix)
    if abs(center[2] - radius) > reach(radius):
        rule = f"wheel {link!r} must touch the ground, which is at z = 0 of {urdf.root!r}"
        heights = f"its centre is at {center[2]:g} m, its radius {radius:g} m"
        raise urdf.error(f"{rule}, but {heights}", "change the z of its joints' <origin>")
    tell_offset(urdf, center[2] - radius, f"wheel {link!r} is above the ground")
    return product(urdf.poses[link].rotation, np.array(shapes[0].pose.position)) + axle, radius


class Axle(NamedTuple):
    """Two opposite wheels."""

    x: float  # position [m] along the robot
    track: float  # distance [m] between the wheel centres
    radius: float  # wheel radius [m]


def measure_axle(urdf: Urdf, names: Sequence[str]) -> Axle:
    """Measure the wheels on two joints, left then right, which must form an axle on the ground."""
    centres, radii = zip(*(wheel(urdf, name) for name in names), strict=True)
    radius = math.fsum(radii) / len(radii)
    if max(radii) - min(radii) > tolerated(radius):
        sizes = " and ".join(f"{radius:g}" for radius in radii)
        axle = f"the wheels of an axle must have equal radii, not {sizes} m ({' and '.join(names)})"
        raise urdf.error(axle, "give both <collision> shapes the same radius")
    tell_offset(urdf, max(radii) - min(radii), "the radii of the wheels of an axle differ")
    return Axle(*place_axle(urdf, names, centres, radius), radius)


def place_axle(
    urdf: Urdf, names: Sequence[str], places: Sequence[Array], radius: float
) -> tuple[float, float]:
    """Return x [m] and the track [m] of an axle from the positions of its joints, left first.

    An InputError is raised if they are not opposite within a tolerance that depends on the
    ``radius`` [m] of the wheels.
    """
    (left_x, left_y, _), (right_x, right_y, _) = (place.tolist() for place in places)
    require_left(urdf, names, left_y, right_y)
    offset = max(abs(left_x - right_x), abs(left_y + right_y))
    if offset > max(tolerated(radius), TOLERATED_SKEW * (left_y - right_y)):
        places_m = f"({left_x:g}, {left_y:g}) and ({right_x:g}, {right_y:g})"
        rule = f"joints {names[0]!r} and {names[1]!r} must be opposite each other"
        raise urdf.error(f"{rule}, not at {places_m}", "match their <origin>")
    tell_offset(urdf, offset, f"joints {names[0]!r} and {names[1]!r} are offset")
    return 0.5 * (left_x + right_x), left_y - right_y


def require_left(urdf: Urdf, names: Sequence[str], left_y: float, right_y: float) -> None:
    """Raise an InputError unless the first of two joints, at these y [m], is on the left."""
    if left_y - right_y < TOLERANCE_M:
        order = f"must be left of {names[1]!r}, but they are at y = {left_y:g} and {right_y:g} m"
        fix = "swap the two names, or correct the <origin> of the joints"
        raise urdf.error(f"joint {names[0]!r} {order}", fix)


def check_caster(urdf: Urdf, link: str, wheels: Sequence[str]) -> None:
    """Raise an InputError unless a caster is a link with a shape that touches the ground."""
    if link in {urdf.joints[name].child for name in wheels}:
        raise urdf.error(f"caster {link!r} must not be a driven wheel", "name another link")
    if link not in urdf.poses:
        known = list_names(sorted(urdf.poses))
        raise urdf.error(f"caster link {link!r} not found", f"name one of: {known}")
    shapes, pose = urdf.shapes[link], urdf.poses[link]
    if not shapes or link == urdf.root:
        rule = f"caster {link!r} must be a separate link with a collision shape"
        raise urdf.error(rule, "add a <link> with a sphere as <collision>")
    height = min(bottom_height(shape, pose @ shape.pose) for shape in shapes)
    if abs(height) > CASTER_GAP_M:
        rule = f"caster {link!r} must touch the ground, which is at z = 0 of {urdf.root!r}"
        fix = "change the z of its joint's <origin>"
        raise urdf.error(f"{rule}, but its lowest point is at {height:g} m", fix)


def find_targets(
    drive: Drive, speed: float, steering: float, left: float = 1.0, right: float = 1.0
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return the angles and rates of a drive's joints when motors are weakened on a side.

    ``left`` and ``right`` are strengths from 0 to 1. If each side has a motor, its strength scales
    the rates of that side. Otherwise one motor drives all wheels through open differentials, so the
    weaker side limits the speed and the robot stays on its curve.
    """
    angles, rates = drive.targets(speed, steering)
    if left == right == 1.0:
        return angles, rates
    if drive.speed_limit_offset_m == 0.0:  # one motor for both sides
        left = right = min(left, right)
    half = len(rates) // 2
    strengths = (left,) * half + (right,) * (len(rates) - half)
    return angles, tuple(a * rate for a, rate in zip(strengths, rates, strict=True))


def lag_gain(step: float, lag: float) -> float:
    """Return the fraction of an error that a first-order lag [s] corrects in a step [s]."""
    return -elementary.expm1(-step / lag) if lag > 0.0 else 1.0


def lag_mean(step: float, lag: float) -> float:
    """Return the mean of a first-order lag over a step [s], as a fraction of its change."""
    # ``a + c (1 - exp(-t / lag))`` has the mean ``a + c (1 - lag / step * gain)``.
    return 1.0 / lag_gain(step, lag) - lag / step
