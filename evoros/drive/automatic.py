"""Finds the drive of a robot from its joints, their names and Gazebo's plugins."""

import logging
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar

from evoros.base.checks import POSITIVE, checked, one_of
from evoros.drive.ackermann import AckermannDescription
from evoros.drive.candidates import NEARLY_ALIGNED, TURNING, Candidate, find_candidates, pair_up
from evoros.drive.differential import DifferentialDescription
from evoros.drive.protocol import Drive, DriveDescription
from evoros.drive.refusals import find_diagonal, refuse_misaligned, refuse_sideways
from evoros.drive.skid_steer import AT_LEAST_ONE, SkidSteerDescription
from evoros.drive.wheels import ANGLE, LINKS, UP
from evoros.formats.urdf.tree import Urdf

_LOG = logging.getLogger(__name__)

KINDS = ("auto", "ackermann", "differential", "skid_steer")
DEFAULT_SPEED_MPS = 0.5  # of a robot whose wheels state no maximum rate
MAX_DEFAULT_SPEED_MPS = 1.0  # whatever rate the wheels state
DEFAULT_STEERING_RAD = 0.5  # of a robot whose steering joints state no limits
MAX_DEFAULT_STEERING_RAD = 0.8  # whatever limits they state
DEFAULT_BICYCLE_STEERING_RAD = 0.9  # of a robot without steering: a radius of 0.79 tracks
_DRIVE_PLUGIN = re.compile(r"diff|skid|acker|drive", re.IGNORECASE)
_JOINT_TAG = re.compile(r"joint", re.IGNORECASE)


@dataclass(frozen=True)
@checked
class AutomaticDescription:
    """Finds wheels, steering joints and casters; what is not null is taken as given."""

    steering_joints: ClassVar[tuple[str, ...]] = ()  # unknown before ``choose``
    wheel_joints: ClassVar[tuple[str, ...]] = ()  # likewise
    kind: Annotated[str, one_of(*KINDS)] = "auto"
    max_speed_mps: Annotated[float | None, POSITIVE] = None
    steering_limit_rad: Annotated[float | None, ANGLE] = None
    wheelbase_m: Annotated[float | None, POSITIVE] = None  # of the bicycle model; not of Ackermann
    wheel_separation_multiplier: Annotated[float | None, POSITIVE] = None  # of skid-steer
    turning_resistance: Annotated[float | None, AT_LEAST_ONE] = None  # of skid-steer
    caster_links: Annotated[Sequence[str], LINKS] = ()

    def fit(self, urdf: Urdf) -> Drive:
        """The drive that is found on this robot."""
        return self.choose(urdf).fit(urdf)

    def choose(self, urdf: Urdf) -> DriveDescription:
        """Find the joints and return the description of the drive that they form.

        Raises:
            InputError: no drive is plain; the error lists the candidates.
        """
        candidates = find_candidates(urdf)
        wheels = _select_driven(urdf, candidates)
        if self.kind in ("auto", "ackermann"):
            refuse_misaligned(urdf, wheels)
        if self.kind == "auto":
            refuse_sideways(urdf, wheels)
        steered = pair_up([wheel for wheel in wheels if wheel.steering is not None])
        others = pair_up([wheel for wheel in wheels if wheel.steering is None])
        if self.kind in ("auto", "ackermann") and len(steered) == len(others) == 1:
            chosen: DriveDescription = self._ackermann(*steered, *others)
        elif self.kind in ("auto", "skid_steer") and not steered and len(others) > 1:
            chosen = self._skid_steer(others)
        elif self.kind in ("auto", "differential") and not steered and len(others) == 1:
            chosen = self._differential(*others)
        else:
            raise self._error(urdf, candidates)
        _tell(urdf, chosen, [wheel for pair in (*steered, *others) for wheel in pair])
        return chosen

    def _ackermann(
        self, front: tuple[Candidate, Candidate], rear: tuple[Candidate, Candidate]
    ) -> AckermannDescription:
        steering = [wheel.steering for wheel in front if wheel.steering is not None]
        stops = [min(j.upper, -j.lower) for j in steering if j.type == "revolute"]
        limits = [stop for stop in stops if stop > 0.0]
        stop = min([*limits, MAX_DEFAULT_STEERING_RAD]) if limits else DEFAULT_STEERING_RAD
        return AckermannDescription(
            steering_joints=tuple(joint.name for joint in steering),
            front_wheel_joints=tuple(wheel.joint.name for wheel in front),
            rear_wheel_joints=tuple(wheel.joint.name for wheel in rear),
            steering_limit_rad=self.steering_limit_rad or stop,
            max_speed_mps=self.max_speed_mps or _speed([*front, *rear]),
            caster_links=tuple(self.caster_links),
        )

    def _differential(self, pair: tuple[Candidate, Candidate]) -> DifferentialDescription:
        return DifferentialDescription(
            wheel_joints=tuple(wheel.joint.name for wheel in pair),
            caster_links=tuple(self.caster_links),
            wheelbase_m=self.wheelbase_m or _track(pair),
            steering_limit_rad=self.steering_limit_rad or DEFAULT_BICYCLE_STEERING_RAD,
            max_speed_mps=self.max_speed_mps or _speed(pair),
        )

    def _skid_steer(self, pairs: Sequence[tuple[Candidate, Candidate]]) -> SkidSteerDescription:
        return SkidSteerDescription(
            left_wheel_joints=tuple(left.joint.name for left, _ in pairs),
            right_wheel_joints=tuple(right.joint.name for _, right in pairs),
            wheelbase_m=self.wheelbase_m or _track(pairs[0]),
            steering_limit_rad=self.steering_limit_rad or DEFAULT_BICYCLE_STEERING_RAD,
            max_speed_mps=self.max_speed_mps or _speed([w for pair in pairs for w in pair]),
            wheel_separation_multiplier=self.wheel_separation_multiplier,
            turning_resistance=self.turning_resistance,
            caster_links=tuple(self.caster_links),
        )

    def _error(self, urdf: Urdf, candidates: Sequence[Candidate]) -> Exception:
        names = ", ".join(wheel.joint.name for wheel in candidates) or "none"
        turning = [
            f"{joint.name} (about the vertical)"
            if abs(float(urdf.axis_of(joint)[UP])) > NEARLY_ALIGNED
            else joint.name
            for joint in urdf.joints.values()
            if joint.type in TURNING
        ]
        wanted = "" if self.kind == "auto" else f" {self.kind}"
        return urdf.error(
            f"the{wanted} drive must be plain from wheels in pairs on the ground; wheels found: "
            f"{names}; turning joints: {', '.join(turning) or 'none'}",
            "name the joints, for example drive@robot.drive=differential "
            "'robot.drive.wheel_joints=[LEFT,RIGHT]' (or ackermann, skid_steer)",
        )


def _select_driven(urdf: Urdf, candidates: Sequence[Candidate]) -> list[Candidate]:
    """Select the wheels that a drive plugin names, or else that have actuators, or else turn.

    Steered wheels count as driven. Fixed wheels are taken if the others form no drive.
    """
    by_name = {wheel.joint.name: wheel for wheel in candidates}
    named = [
        text
        for plugin in urdf.plugins
        if _DRIVE_PLUGIN.search(plugin.name)
        for tag, texts in plugin.texts.items()
        if _JOINT_TAG.search(tag)
        for text in texts
    ]
    for names in (named, urdf.actuated):
        chosen = [by_name[name] for name in dict.fromkeys(names) if name in by_name]
        chosen += [w for w in candidates if w.steering is not None and w not in chosen]
        if pair_up([w for w in chosen if w.steering is None]):
            return sorted(chosen, key=lambda wheel: list(by_name).index(wheel.joint.name))
    turning = [wheel for wheel in candidates if wheel.turns]
    plain = pair_up([wheel for wheel in turning if wheel.steering is None])
    return turning if plain else list(candidates)


def _track(pair: tuple[Candidate, Candidate]) -> float:
    return round(pair[0].y - pair[1].y, 6)


def _speed(wheels: Sequence[Candidate]) -> float:
    """Return the default maximum speed [m/s], which the slowest wheel sets."""
    speeds = [
        wheel.joint.velocity * wheel.wheel.radius for wheel in wheels if wheel.joint.velocity > 0.0
    ]
    speed = min([*speeds, MAX_DEFAULT_SPEED_MPS]) if speeds else DEFAULT_SPEED_MPS
    return round(speed, 6)


def _tell(urdf: Urdf, chosen: DriveDescription, wheels: Sequence[Candidate]) -> None:
    """Report the drive, its limits and the joints that are made to turn."""
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
            "%s: Gazebo turns the friction of these wheels by 45 deg (<fdir1>), as of mecanum "
            "wheels; they are taken as plain wheels, so correct the drive if they have rollers: %s",
            urdf.source,
            ", ".join(diagonal),
        )
    fixed = [wheel.joint.name for wheel in wheels if not wheel.turns]
    if fixed:
        _LOG.warning("%s: fixed wheels are made to turn: %s", urdf.source, ", ".join(fixed))
