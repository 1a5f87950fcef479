"""Detects a robot's drive from joints, names and Gazebo plugins; rejects unsupported drives."""

import logging
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from itertools import chain
from pathlib import Path
from pkgutil import iter_modules
from typing import Annotated

import numpy as np

from evoros.base import elementary
from evoros.base.checks import POSITIVE, checked, one_of
from evoros.base.errors import InputError
from evoros.drive import protocol
from evoros.drive.candidates import (
    NEARLY_ALIGNED,
    TURNING,
    find_candidates,
    find_flaw,
    find_misaligned,
    is_called_wheel,
    pair_up,
    read_wheel,
    select_driven,
)
from evoros.drive.evidence import (
    PUSHING_PLUGIN,
    find_bogies,
    find_diagonal,
    find_dragged,
    find_rollers,
    name_sideways_plugin,
    read_kind,
    slides,
)
from evoros.drive.rolling import Candidate, Pair
from evoros.drive.skid_steer import AT_LEAST_ONE
from evoros.formats.notes import list_notes
from evoros.formats.urdf.parts import Joint
from evoros.formats.urdf.tree import Urdf

HOLD_STRAIGHT = "set robot.drive.kind={} to lock the steering and turn by wheel speeds alone"


def refuse_articulated(urdf: Urdf, wheels: Sequence[Candidate]) -> None:
    """Reject a machine with steering joints that turn an axle, a frame or wheels off the axle."""
    turned: dict[str, list[Candidate]] = {}
    for wheel in wheels:
        if wheel.steering is not None:
            turned.setdefault(wheel.steering.name, []).append(wheel)
    for name, carried in turned.items():
        pivot = urdf.poses[urdf.joints[name].child].position[0]
        gap, radius = min(abs(wheel.x - pivot) for wheel in carried), carried[0].wheel.radius
        names, fixes = ", ".join(wheel.joint.name for wheel in carried), []
        if any(wheel.y > 0.0 for wheel in carried) and any(wheel.y <= 0.0 for wheel in carried):
            problem = "bends its frame" if gap > radius else "steers a whole axle"
            problem += f" at joint {name!r}, which turns the wheels {names} together"
        elif len(turned) == 2 and gap > protocol.tolerated(radius):
            problem = f"steers wheel {names} about {name!r}, whose axis is {gap:.3g} m away"
            others = _choose_kind(pair_up([wheel for wheel in wheels if wheel.steering is None]))
            if others:
                fixes = [f"set robot.drive.kind={others} if such wheels only trail, as casters do"]
        else:
            continue
        fixes.append(HOLD_STRAIGHT.format(_choose_kind(pair_up(wheels))))
        raise urdf.error(f"the robot {problem}; no drive supports this", ", or ".join(fixes))


def refuse_several(urdf: Urdf, wheels: Sequence[Candidate]) -> None:
    """Reject a description of several vehicles: joints that each carry axles on both sides."""
    carried: dict[Joint, list[Candidate]] = {}
    for wheel in wheels:
        above = list(urdf.joints_above(wheel.joint.child))[1:]
        moving = [joint for joint in above if joint.type != "fixed"]
        if moving:
            carried.setdefault(moving[-1], []).append(wheel)
    vehicles = {
        joint: ", ".join(wheel.joint.name for wheel in group)
        for joint, group in carried.items()
        if np.ptp([(w.x, w.y) for w in group], axis=0).min() > 2.0 * group[0].wheel.radius
    }
    if len(vehicles) > 1:
        parts = "; ".join(f"{joint.name} carries {names}" for joint, names in vehicles.items())
        raise urdf.error(
            f"the file describes {len(vehicles)} vehicles instead of one: {parts}",
            f"write a file for each vehicle, such as {next(iter(vehicles)).child} with all links "
            "below it",
        )


def refuse_sideways(urdf: Urdf, wheels: Sequence[Candidate]) -> None:
    """Reject a robot whose wheels or controller also move it sideways.

    If the robot has plain wheels and only a Gazebo plugin moves it sideways, this is only logged,
    unless the robot's name confirms it or the wheels slide in Gazebo.
    """
    pairs = pair_up([wheel for wheel in wheels if wheel.steering is None])
    turning = [joint for joint in urdf.joints.values() if joint.type in TURNING]
    # The fingers of a hand are no rollers.
    called = [j for j in turning if is_called_wheel(j) or read_kind([j.name, j.child])]
    joints = [wheel.joint for wheel in wheels] if pairs else called
    reason = next(filter(None, (find_rollers(urdf, joint) for joint in joints)), "")
    plugin = name_sideways_plugin(urdf.plugins)
    if plugin and not reason:  # neither names nor slippery wheels suffice as evidence
        reason = read_kind([urdf.name, Path(urdf.source).name])
        if len(pairs) > 1 and all(slides(urdf, joint) for joint in joints):
            reason = f"wheels slide in Gazebo, where plugin {plugin} moves the robot"
    if not reason and plugin and (len(pairs) == 1 or (pairs and PUSHING_PLUGIN.search(plugin))):
        _LOG.warning(
            f"{urdf.source}: the Gazebo plugin {plugin} can also push the robot sideways; "
            "missions do not use this motion, and the wheels are simulated as plain wheels"
        )
    elif reason or plugin:
        kind = _choose_kind(pairs)
        names = ", ".join(joint.name for joint in joints) or "none that turn"
        reason = reason or f"Gazebo plugin {plugin}"
        plain = "to simulate the robot with plain wheels, which slip in turns"
        raise urdf.error(
            f"the robot also moves sideways ({reason}), but no drive does; wheels: {names}",
            f"set robot.drive.kind={kind} {plain}"
            if kind
            else "write a drive for the robot (docs/parts/drive.md)",
        )


def refuse_facing_sideways(urdf: Urdf) -> None:
    """Reject a robot with wheels that all roll along its y axis."""
    turning = [joint for joint in urdf.joints.values() if joint.type in TURNING]
    wheels = [j for j in turning if is_called_wheel(j)]
    if len(wheels) > 1 and all(
        abs(urdf.axis_of(j)[protocol.FORWARD]) > NEARLY_ALIGNED for j in wheels
    ):
        raise urdf.error(
            f"the robot must drive forward along x (REP 103), but these wheels roll along y: "
            f"{', '.join(joint.name for joint in wheels)}",
            f'attach the root link {urdf.root} to a new root through a fixed joint with rpy="0 '
            '0 -1.5708" (or "0 0 1.5708" if the robot faces along -y)',
        )


def refuse_misaligned(urdf: Urdf, wheels: Sequence[Candidate]) -> None:
    """Reject a robot with wheels whose axes are not lateral."""
    joints = find_misaligned(urdf, wheels)
    if joints:
        pairs = pair_up([wheel for wheel in wheels if wheel.steering is None])
        kind = _choose_kind(pairs)
        fixes = ["correct the <axis>", *([HOLD_STRAIGHT.format(kind)] if kind else [])]
        rolling = pair_up([*(read_wheel(urdf, joint.name) for joint in joints), *wheels])
        if rolling:
            keys = _name_wheels(rolling)
            fixes.append(f"let the wheels roll about the lateral axis (y) with {keys}")
        raise misaligned_error(urdf, joints, ", or ".join(fixes))


def misaligned_error(urdf: Urdf, joints: Sequence[Joint], fix: str) -> InputError:
    """Return the error for wheels whose axes are not lateral."""
    names = ", ".join(joint.name for joint in joints)
    if all(abs(float(urdf.axis_of(joint)[protocol.UP])) > NEARLY_ALIGNED for joint in joints):
        problem = "joints with a vertical axis steer their wheels instead of rolling them"
        return urdf.error(f"{problem}: {names}", f"add a joint below for each wheel; {fix}")
    cosines = [min(abs(float(urdf.axis_of(joint)[protocol.LEFT])), 1.0) for joint in joints]
    angles = ", ".join(f"{math.degrees(elementary.acos(cosine)):.0f}" for cosine in cosines)
    rule = f"wheel axes must point left (y), but deviate by {angles} deg: {names}"
    hint = "steered wheels need the ackermann drive; no drive supports omni wheels"
    return urdf.error(rule, f"{fix} ({hint})")


def _find_drives() -> Mapping[str, type[protocol.DriveDescription]]:
    """Return the drives in this folder that can be detected, keyed by file name."""
    drives = {}
    for file in iter_modules([str(Path(__file__).parent)]):
        module = import_module(f"{__package__}.{file.name}")
        for kind in protocol.DriveDescription.__subclasses__():
            if kind.__module__ == module.__name__ and "recognise" in vars(kind):
                drives[file.name] = kind
    return drives


_LOG = logging.getLogger(__name__)

DRIVES = _find_drives()  # drives that can be detected, keyed by ``kind``


def _choose_kind(pairs: Sequence[Pair]) -> str:
    """Return the kind of drive that pairs of wheels form with locked steering, or ""."""
    given: Mapping[str, Sequence[str]] = {"caster_links": ()}
    return next((name for name, kind in DRIVES.items() if kind.recognise([], pairs, given)), "")


def _name_wheels(pairs: Sequence[Pair]) -> str:
    """Return the keys that make pairs of wheels a drive without steering."""
    left, right = (",".join(w.joint.name for w in side) for side in zip(*pairs, strict=True))
    return (
        f"robot.drive.kind={_choose_kind(pairs)} 'robot.drive.left_wheel_joints=[{left}]' "
        f"'robot.drive.right_wheel_joints=[{right}]'"
    )


GIVEN = (
    *("max_speed_mps", "steering_limit_rad", "wheelbase_m", "caster_links"),
    *("wheel_separation_multiplier", "turning_resistance"),
)
"""Fields that the user may set to replace values detected on the robot."""


@dataclass(frozen=True)
@checked
class AutomaticDescription(protocol.DriveDescription):
    """Detects wheels, steering joints and casters, except those given by the user."""

    steering_joints = ()  # unknown until ``choose``, as are the wheels
    wheel_joints = ()
    kind: Annotated[str, one_of("auto", *DRIVES)] = "auto"
    left_wheel_joints: Annotated[
        Sequence[str], protocol.JOINTS
    ] = ()  # front to rear; detected if empty
    right_wheel_joints: Annotated[Sequence[str], protocol.JOINTS] = ()  # opposite the left wheels
    max_speed_mps: Annotated[float | None, POSITIVE] = None
    steering_limit_rad: Annotated[float | None, protocol.ANGLE] = None
    wheelbase_m: Annotated[float | None, POSITIVE] = None  # not for Ackermann
    wheel_separation_multiplier: Annotated[float | None, POSITIVE] = None  # skid-steer only
    turning_resistance: Annotated[float | None, AT_LEAST_ONE] = None  # skid-steer only
    caster_links: Annotated[Sequence[str], protocol.LINKS] = ()

    def fit(self, urdf: Urdf) -> protocol.Drive:
        """Return the drive detected on a robot."""
        return self.choose(urdf).fit(urdf)

    def choose(self, urdf: Urdf) -> protocol.DriveDescription:
        """Return the description of the drive formed by a robot's joints."""
        named = self.left_wheel_joints or self.right_wheel_joints
        pairs = self._read_pairs(urdf) if named else self._find_pairs(urdf)
        kinds = list(DRIVES.values()) if self.kind == "auto" else [DRIVES[self.kind]]
        steers = any(kind.steers for kind in kinds)
        steered = [pair for pair in pairs if pair[0].steering is not None] if steers else []
        others = [pair for pair in pairs if pair not in steered]
        given = {name: getattr(self, name) for name in GIVEN if getattr(self, name) is not None}
        recognised = (kind.recognise(steered, others, given) for kind in kinds)
        chosen = next(filter(None, recognised), None)
        if chosen is None:
            raise self._error(urdf, steered, others)
        _tell(urdf, chosen, [wheel for pair in pairs for wheel in pair])
        return chosen

    def _find_pairs(self, urdf: Urdf) -> list[Pair]:
        wheels = select_driven(urdf, find_candidates(urdf))
        fixed = pair_up([wheel for wheel in wheels if wheel.steering is None])
        kind = DRIVES.get(self.kind)
        if kind is not None and not kind.steers:
            return pair_up(wheels) if kind.locks_steering or not fixed else fixed
        refuse_misaligned(urdf, wheels)
        refuse_several(urdf, wheels)
        refuse_articulated(urdf, wheels)
        if self.kind == "auto":
            refuse_sideways(urdf, wheels)
        return pair_up([wheel for wheel in wheels if wheel.steering is not None]) + fixed

    def _read_pairs(self, urdf: Urdf) -> list[Pair]:
        if len(self.left_wheel_joints) != len(self.right_wheel_joints):
            fix = "set robot.drive.left_wheel_joints and right_wheel_joints"
            raise urdf.error("both sides must have the same number of wheels", fix)
        sides = (self.left_wheel_joints, self.right_wheel_joints)
        left, right = ([read_wheel(urdf, name) for name in names] for names in sides)
        for one, other in zip(left, right, strict=True):
            protocol.require_left(urdf, (one.joint.name, other.joint.name), one.y, other.y)
        return list(zip(left, right, strict=True))

    def _error(self, urdf: Urdf, steered: Sequence[Pair], others: Sequence[Pair]) -> Exception:
        if len(steered) > 1 or (steered and len(others) > 1):
            axles = f"the robot has {len(steered)} steered and {len(others)} other axles"
            bogies = find_bogies(urdf, [wheel for pair in [*steered, *others] for wheel in pair])
            if bogies:
                axles = f"{axles} on a rocker-bogie ({', '.join(bogies)})"
            return urdf.error(
                f"drives with steering have one steered and one fixed axle, but {axles}",
                HOLD_STRAIGHT.format(_choose_kind([*steered, *others])),
            )
        candidates = find_candidates(urdf)
        if not candidates:
            refuse_facing_sideways(urdf)
        pairs = pair_up([wheel for wheel in find_candidates(urdf, casters=True) if wheel.turns])
        if pairs and not pair_up(candidates):
            names = ", ".join(wheel.joint.name for pair in pairs for wheel in pair)
            return urdf.error(
                f"all wheels are casters, according to their names: {names}",
                f"if these wheels are driven, type {_name_wheels(pairs)}",
            )
        names = ", ".join(wheel.joint.name for wheel in candidates) or "none"
        turning = [
            f"{joint.name}{find_flaw(urdf, joint)}"
            for joint in urdf.joints.values()
            if joint.type in TURNING
        ]
        if not candidates and not turning:
            raise urdf.error(
                "no wheels found: no joint turns, and no round part is on the ground",
                "add links and joints for the wheels",
            )
        wanted = "" if self.kind == "auto" else f" {self.kind}"
        return urdf.error(
            f"no{wanted} drive could be detected from pairs of wheels on the ground; wheels found: "
            f"{names}; turning joints: {', '.join(turning) or 'none'}",
            "name the joints of all wheels, front to rear, with "
            "'robot.drive.left_wheel_joints=[LEFT]' 'robot.drive.right_wheel_joints=[RIGHT]'",
        )


def _tell(urdf: Urdf, chosen: protocol.DriveDescription, wheels: Sequence[Candidate]) -> None:
    kind = type(chosen).__name__.removesuffix("Description")
    limits = [
        f"{key}={getattr(chosen, key):g}"
        for key in ("max_speed_mps", "steering_limit_rad", "wheelbase_m")
        if hasattr(chosen, key) and math.isfinite(getattr(chosen, key))
    ]
    steering = f"; steering {', '.join(chosen.steering_joints)}" if chosen.steering_joints else ""
    drive = f"{kind}; wheels {', '.join(chosen.wheel_joints)}{steering}; {', '.join(limits)}"
    _LOG.warning("%s: drive found: %s (set robot.drive to change it)", urdf.source, drive)
    diagonal = find_diagonal(urdf, wheels)
    driven = urdf.actuated - {*chosen.wheel_joints, *chosen.steering_joints}
    called = (joint for joint in urdf.joints.values() if is_called_wheel(joint))
    # wheels off the ground, for example
    left_out = [joint.name for joint in called if joint.name in driven]
    slippery = [wheel.joint.name for wheel in wheels if slides(urdf, wheel.joint)]
    fixed = [wheel.joint.name for wheel in wheels if not wheel.turns]
    bogies = find_bogies(urdf, wheels)
    pairs = pair_up(find_dragged(urdf, chosen.wheel_joints)) if chosen.on_one_axle else []
    dragged = [*chain.from_iterable(pairs)]
    keys = _name_wheels(pair_up([*wheels, *dragged])) if dragged else ""
    notes = {
        f"in evoros, these wheels slide without friction, although they cannot swivel; to drive "
        f"them as well, type {keys}": [wheel.joint.name for wheel in dragged],
        "friction of these wheels is rotated by 45 deg in Gazebo (<fdir1>), as for mecanum "
        "wheels, but evoros treats them as plain wheels; set robot.drive if the wheels have "
        "rollers": diagonal,
        "in evoros, these wheels grip, although they slide in Gazebo (<mu> is 0)": slippery,
        "the drive leaves out these driven wheels": left_out,
        "in evoros, these wheels turn freely, although their joints are fixed": fixed,
        "the joints of a rocker-bogie are locked, so some wheels may not touch the ground": bogies,
    }
    for note in list_notes(notes):
        _LOG.warning("%s: %s", urdf.source, note)
