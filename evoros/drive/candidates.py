"""Finds the wheels and steering joints of a robot by shape, position and name."""

import math
import re
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from evoros.base import elementary
from evoros.drive.protocol import LEFT, UP, reach, tolerated
from evoros.drive.rolling import Candidate, Pair, Wheel, group_shapes, measure_wheel
from evoros.formats.urdf.parts import Joint
from evoros.formats.urdf.tree import Urdf

ALIGNED = elementary.cos(math.radians(5.0))  # minimum cosine of the angle between parallel axes
NEARLY_ALIGNED = elementary.cos(math.radians(20.0))
"""Minimum cosine of the angle between a wheel axis and the robot's lateral axis."""
TURNING = ("continuous", "revolute")
CASTER = re.compile(r"caster|castor|swivel|omni|ball", re.IGNORECASE)
_OMNI = re.compile(r"omni", re.IGNORECASE)
_DRIVE_PLUGIN = re.compile(r"diff|skid|acker|drive", re.IGNORECASE)
_JOINT_TAG = re.compile(r"joint", re.IGNORECASE)
_SEPARATOR = re.compile(r"[,\s]+")  # separator of joint names in a plugin
_WHEEL = re.compile(r"wheel|whl|tire|tyre|hub(?!cap)", re.IGNORECASE)
_STEERING = re.compile(r"steer|hinge|knuckle|kingpin|ackermann", re.IGNORECASE)
MAX_LACK = 0.15  # maximum deviation from roundness of a part that may be a wheel
MIN_RADIUS_M = 0.01  # radius [m] up to which a part is a wheel only if the user names it
DEFAULT_SPEED_MPS = 0.5  # default if wheels have no velocity limit
MAX_DEFAULT_SPEED_MPS = 1.0  # maximum default speed, even if wheels have a higher limit
DEFAULT_BICYCLE_STEERING_RAD = 0.9  # default without steering; the turning radius is 0.79 tracks


def read_wheel(urdf: Urdf, name: str) -> Candidate:
    """Return the wheel on a joint named by the user."""
    joint = urdf.find_joint(name, *TURNING, "fixed")
    wheel = measure_link(urdf, joint.child, 0.0)
    if wheel is None:
        problem = f"wheel {joint.child!r} must have a <collision> or a <visual>"
        raise urdf.error(problem, "add a <collision> with a cylinder")
    above = list(urdf.joints_above(joint.child))
    return Candidate(joint, wheel, joint.type in TURNING, _find_steering(urdf, above[1:]))


def _list_round(urdf: Urdf, casters: bool = False) -> Iterator[tuple[Joint, float, Wheel]]:
    """Yield each round part: joint, |cosine| of the angle from its axis to lateral, wheel."""
    for joint in urdf.joints.values():
        driven = joint.name in urdf.actuated
        names = [name for j in urdf.joints_above(joint.child) for name in (j.name, j.child)]
        names = [_OMNI.sub("", name) if driven else name for name in names]
        if casters or not any(map(CASTER.search, names)):
            wheel = measure_link(urdf, joint.child)
            if wheel is not None and wheel.roundness < MAX_LACK:
                yield joint, abs(float(urdf.axis_of(joint)[LEFT])), wheel


def find_candidates(urdf: Urdf, casters: bool = False) -> list[Candidate]:
    """Return parts that look like wheels and touch the ground; casters only if ``casters``."""
    candidates: dict[str, Candidate] = {}
    for joint, along, wheel in _list_round(urdf, casters):
        turns = joint.type in TURNING
        likely = joint.type == "fixed" or (turns and along > NEARLY_ALIGNED)
        if (turns and along > ALIGNED) or (likely and is_called_wheel(joint)):
            steering = _find_steering(urdf, list(urdf.joints_above(joint.child))[1:])
            if casters or steering is None or not _trails(urdf, steering, wheel):
                candidates[joint.name] = Candidate(joint, wheel, turns, steering)
    outer = [c for c in candidates.values() if not _inside_another(urdf, c, candidates)]
    if not outer:
        return []
    turning = [c for c in outer if c.turns] or outer
    ground = min(c.wheel.bottom for c in turning)
    return [c for c in outer if abs(c.wheel.bottom - ground) < reach(c.wheel.radius)]


def find_misaligned(urdf: Urdf, wheels: Sequence[Candidate]) -> list[Joint]:
    """Return the joints of wheels (except spheres) on the ground that have no lateral axis."""
    ground = min((wheel.wheel.bottom for wheel in wheels), default=None)
    found: dict[Joint, Wheel] = {}
    for joint, along, wheel in _list_round(urdf):
        carries = any(j.type in TURNING for j in urdf.children_of(joint.child))
        ball = all(shape.kind == "sphere" for shape, _ in group_shapes(urdf, joint.child))
        if joint.type not in TURNING or along > NEARLY_ALIGNED or carries or ball:
            continue
        if ground is None or abs(wheel.bottom - ground) < reach(wheel.radius):
            found[joint] = wheel
    radii = [wheel.radius for joint, wheel in found.items() if is_called_wheel(joint)]
    alike = (any(abs(r - wheel.radius) < tolerated(r) for r in radii) for wheel in found.values())
    return [joint for joint, is_wheel in zip(found, alike, strict=True) if is_wheel]


def is_called_wheel(joint: Joint) -> bool:
    """Return True if a joint or its child link has the name of a wheel."""
    return bool(_WHEEL.search(joint.name) or _WHEEL.search(joint.child))


def _trails(urdf: Urdf, swivel: Joint, wheel: Wheel) -> bool:
    """Return True if a wheel trails an undriven joint, as on swivel casters."""
    texts = (texts for plugin in urdf.plugins for texts in plugin.texts.values())
    if swivel.name in urdf.actuated or any(swivel.name in text for text in texts):
        return False
    x, y, _ = map(float, abs(wheel.centre - urdf.poses[swivel.child].position))
    return tolerated(wheel.radius) < x < 2.0 * wheel.radius and y < wheel.radius


def measure_link(urdf: Urdf, link: str, smallest_m: float = MIN_RADIUS_M) -> Wheel | None:
    """Measure a link about the lateral axis; None if its radius is at most ``smallest_m``."""
    pose = urdf.poses[link]
    shapes = [(shape, pose @ local) for shape, local in group_shapes(urdf, link)]
    if not shapes:
        return None
    wheel = measure_wheel(shapes, np.array([0.0, 1.0, 0.0]))
    return wheel if wheel.radius > smallest_m else None


def _find_steering(urdf: Urdf, above: Sequence[Joint]) -> Joint | None:
    for joint in above:
        if joint.type in TURNING and abs(float(urdf.axis_of(joint)[UP])) > NEARLY_ALIGNED:
            return joint
    for joint in above:
        if joint.type == "fixed" and _STEERING.search(f"{joint.name} {joint.child}"):
            return joint
    return None


def _inside_another(urdf: Urdf, candidate: Candidate, others: Mapping[str, Candidate]) -> bool:
    """Return True if the candidate is only a part of another candidate's wheel."""
    above = list(urdf.joints_above(candidate.joint.child))[1:]
    turning = (other for other in others.values() if other.turns and other is not candidate)
    if any(candidate.joint in urdf.joints_above(other.joint.child) for other in turning):
        return True
    return not candidate.turns and any(joint.name in others for joint in above)


def pair_up(candidates: Sequence[Candidate]) -> list[Pair]:
    """Return pairs (left, right) of opposite wheels, from front to rear."""
    left = [c for c in candidates if c.y > 0.0]
    right = [c for c in candidates if c.y <= 0.0]
    pairs = []
    for one in sorted(left, key=lambda c: -c.x):
        opposite = [c for c in right if _are_opposite(one, c)]
        if opposite:
            # Twin wheels on an axle form pairs at equal distances from the middle.
            nearest = min(opposite, key=lambda c: (round(abs(c.x - one.x), 6), abs(c.y + one.y)))
            pairs.append((one, nearest))
            right.remove(pairs[-1][1])
    return pairs


def _are_opposite(left: Candidate, right: Candidate) -> bool:
    apart = 2.0 * max(reach(left.wheel.radius), reach(right.wheel.radius))
    middle = abs(left.y + right.y) / 2.0
    return abs(left.x - right.x) < apart and middle < 0.25 * abs(left.y - right.y)


def select_driven(urdf: Urdf, candidates: Sequence[Candidate]) -> list[Candidate]:
    """Select the wheels named by a drive plugin or, without one, actuated or turning wheels.

    Steered wheels are driven. Fixed wheels are included if the other wheels form no drive.
    """
    by_name = {wheel.joint.name: wheel for wheel in candidates}
    named = [
        name
        for plugin in urdf.plugins
        if _DRIVE_PLUGIN.search(plugin.name)
        for tag, texts in plugin.texts.items()
        if _JOINT_TAG.search(tag)
        for text in texts
        for name in _SEPARATOR.split(text)
    ]
    for names in (named, urdf.actuated):
        chosen = [by_name[name] for name in dict.fromkeys(names) if name in by_name]
        chosen += [w for w in candidates if w.steering is not None and w not in chosen]
        if pair_up([w for w in chosen if w.steering is None]):
            return sorted(chosen, key=lambda wheel: list(by_name).index(wheel.joint.name))
    turning = [wheel for wheel in candidates if wheel.turns]
    plain = pair_up([wheel for wheel in turning if wheel.steering is None])
    return turning if plain else list(candidates)


def default_speed(wheels: Sequence[Candidate]) -> float:
    """Return the default maximum speed [m/s], which depends on the slowest wheel."""
    speed = min(wheel.joint.velocity * wheel.wheel.radius for wheel in wheels)
    return DEFAULT_SPEED_MPS if math.isinf(speed) else round(min(speed, MAX_DEFAULT_SPEED_MPS), 6)


def default_bicycle(pairs: Sequence[Pair]) -> dict[str, float]:
    """Return default limits and a default wheelbase of the bicycle model, without steering."""
    left, right = pairs[0]
    return {
        "wheelbase_m": round(left.y - right.y, 6),
        "steering_limit_rad": DEFAULT_BICYCLE_STEERING_RAD,
        "max_speed_mps": default_speed([wheel for pair in pairs for wheel in pair]),
    }


def find_flaw(urdf: Urdf, joint: Joint) -> str:
    """Return, in brackets, why a turning joint carries no wheel; "" if it may carry one."""
    if abs(float(urdf.axis_of(joint)[UP])) > NEARLY_ALIGNED:
        return " (vertical axis)"
    part = measure_link(urdf, joint.child, 0.0)
    if part is None:
        return " (no shape)"
    if part.radius <= MIN_RADIUS_M:
        return f" (radius {part.radius:g} m, too small to be a wheel unless its joint is named)"
    return " (not round about the y axis)" if part.roundness >= MAX_LACK else ""
