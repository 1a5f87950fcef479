"""Detects the drive of a robot from its joints, their names and Gazebo plugins."""

import logging
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

from evoros.base.checks import POSITIVE, checked, one_of
from evoros.drive.ackermann import AckermannDescription
from evoros.drive.candidates import (
    NEARLY_ALIGNED,
    TURNING,
    find_candidates,
    is_called_wheel,
    pair_up,
    read_wheel,
    select_driven,
)
from evoros.drive.differential import DifferentialDescription
from evoros.drive.protocol import Drive, DriveDescription
from evoros.drive.refusals import (
    HOLD_STRAIGHT,
    find_diagonal,
    refuse_articulated,
    refuse_facing_sideways,
    refuse_misaligned,
    refuse_sideways,
)
from evoros.drive.rolling import Candidate, Pair
from evoros.drive.skid_steer import AT_LEAST_ONE, SkidSteerDescription
from evoros.drive.wheels import ANGLE, JOINTS, LINKS, UP
from evoros.formats.urdf.tree import Urdf

_LOG = logging.getLogger(__name__)

DRIVES: Mapping[str, type[DriveDescription]] = {
    "ackermann": AckermannDescription,
    "differential": DifferentialDescription,
    "skid_steer": SkidSteerDescription,
}
"""The drives that can be recognised, by the value of ``kind``."""
GIVEN = (
    *("max_speed_mps", "steering_limit_rad", "wheelbase_m", "caster_links"),
    *("wheel_separation_multiplier", "turning_resistance"),
)
"""Fields that the user may set; the drive uses them instead of the robot's values."""


@dataclass(frozen=True)
@checked
class AutomaticDescription(DriveDescription):
    """Detects wheels, steering joints and casters; values that are not null are used as given."""

    steering_joints = ()  # unknown until ``choose``, like the wheels
    wheel_joints = ()
    kind: Annotated[str, one_of("auto", *DRIVES)] = "auto"
    left_wheel_joints: Annotated[Sequence[str], JOINTS] = ()  # front to rear; empty: detected
    right_wheel_joints: Annotated[Sequence[str], JOINTS] = ()  # opposite the left ones
    max_speed_mps: Annotated[float | None, POSITIVE] = None
    steering_limit_rad: Annotated[float | None, ANGLE] = None
    wheelbase_m: Annotated[float | None, POSITIVE] = None  # not for Ackermann
    wheel_separation_multiplier: Annotated[float | None, POSITIVE] = None  # skid-steer only
    turning_resistance: Annotated[float | None, AT_LEAST_ONE] = None  # skid-steer only
    caster_links: Annotated[Sequence[str], LINKS] = ()

    def fit(self, urdf: Urdf) -> Drive:
        """Return the drive detected on this robot."""
        return self.choose(urdf).fit(urdf)

    def choose(self, urdf: Urdf) -> DriveDescription:
        """Detect the joints and return the description of the drive that they form.

        Raises:
            InputError: the drive is ambiguous or unknown; the error lists the candidates.
        """
        named = self.left_wheel_joints or self.right_wheel_joints
        pairs = self._read_pairs(urdf) if named else self._find_pairs(urdf)
        straight = self.kind in ("differential", "skid_steer")
        steered = [] if straight else [pair for pair in pairs if pair[0].steering is not None]
        others = [pair for pair in pairs if pair not in steered]
        given = {name: getattr(self, name) for name in GIVEN if getattr(self, name) is not None}
        kinds = DRIVES.values() if self.kind == "auto" else [DRIVES[self.kind]]
        recognised = (kind.recognise(steered, others, given) for kind in kinds)
        chosen = next(filter(None, recognised), None)
        if chosen is None:
            raise self._error(urdf, len(steered), len(others))
        _tell(urdf, chosen, [wheel for pair in pairs for wheel in pair])
        return chosen

    def _find_pairs(self, urdf: Urdf) -> list[Pair]:
        """Find pairs of drive wheels; reject machines that only look like this kind of drive."""
        wheels = select_driven(urdf, find_candidates(urdf))
        fixed = pair_up([wheel for wheel in wheels if wheel.steering is None])
        if self.kind == "differential":
            return fixed
        if self.kind == "skid_steer":  # all wheels are driven, and their steering is held
            return pair_up(wheels)
        refuse_misaligned(urdf, wheels)
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
        return list(zip(left, right, strict=True))

    def _error(self, urdf: Urdf, steered: int, others: int) -> Exception:
        if steered > 1 or (steered and others > 1):
            axles = f"it has {steered} steered and {others} other axles"
            return urdf.error(
                f"no drive steers more than one of two axles (Ackermann), and {axles}",
                HOLD_STRAIGHT.format("skid_steer"),
            )
        candidates = find_candidates(urdf)
        if not candidates:
            refuse_facing_sideways(urdf)
        names = ", ".join(wheel.joint.name for wheel in candidates) or "none"
        turning = [
            f"{joint.name} (about the vertical)"
            if abs(float(urdf.axis_of(joint)[UP])) > NEARLY_ALIGNED
            else joint.name
            for joint in urdf.joints.values()
            if joint.type in TURNING
        ]
        if not candidates and not turning:
            raise urdf.error(
                "a drive must have wheels, but no joint turns and no round part is on the ground",
                "add the links and joints of the wheels",
            )
        wanted = "" if self.kind == "auto" else f" {self.kind}"
        return urdf.error(
            f"the{wanted} drive must be clear from pairs of wheels on the ground; wheels found: "
            f"{names}; turning joints: {', '.join(turning) or 'none'}",
            "name the joints of all wheels, front to rear, with "
            "'robot.drive.left_wheel_joints=[LEFT]' 'robot.drive.right_wheel_joints=[RIGHT]'",
        )


def _tell(urdf: Urdf, chosen: DriveDescription, wheels: Sequence[Candidate]) -> None:
    """Log the drive, its limits and the fixed joints that now turn."""
    kind = type(chosen).__name__.removesuffix("Description")
    limits = [
        f"{key}={getattr(chosen, key):g}"
        for key in ("max_speed_mps", "steering_limit_rad", "wheelbase_m")
        if hasattr(chosen, key) and math.isfinite(getattr(chosen, key))
    ]
    steering = f"; steering {', '.join(chosen.steering_joints)}" if chosen.steering_joints else ""
    drive = f"{kind}; wheels {', '.join(chosen.wheel_joints)}{steering}; {', '.join(limits)}"
    _LOG.warning("%s: drive found: %s (keys of robot.drive)", urdf.source, drive)
    diagonal = find_diagonal(urdf, wheels)
    if diagonal:
        _LOG.warning(
            "%s: Gazebo rotates the friction of these wheels by 45 deg (<fdir1>), like mecanum "
            "wheels; they are treated as plain wheels; set robot.drive if they have rollers: %s",
            urdf.source,
            ", ".join(diagonal),
        )
    driven = urdf.actuated - {*chosen.wheel_joints, *chosen.steering_joints}
    called = (joint for joint in urdf.joints.values() if is_called_wheel(joint))
    left_out = ", ".join(joint.name for joint in called if joint.name in driven)
    if left_out:  # such as wheels in the air
        _LOG.warning("%s: driven wheels are not part of the drive: %s", urdf.source, left_out)
    fixed = [wheel.joint.name for wheel in wheels if not wheel.turns]
    if fixed:
        _LOG.warning("%s: fixed wheels are made to turn: %s", urdf.source, ", ".join(fixed))
