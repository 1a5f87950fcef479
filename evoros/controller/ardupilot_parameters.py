"""Settings of the ArduPilot controller, and autopilot parameters derived from them."""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any

from evoros.base import checks, elementary
from evoros.base.errors import InputError
from evoros.controller.line_controller import split_command
from evoros.controller.protocol import LOCALIZATION, Briefing, Layer, LiveController, Localizer
from evoros.robot.model import Robot
from evoros.sensor.protocol import RangeSensor, sees

_MAX_PERIOD_S = 0.02
PERIOD = checks.Rule(
    f"a number greater than 0 and at most {_MAX_PERIOD_S} (ArduPilot does not arm at fewer than "
    "50 states per second)",
    lambda v: checks.is_number(v) and 0 < v <= _MAX_PERIOD_S + 1e-12,
)
_PARAMETERS = checks.Rule(
    "a mapping from ArduPilot parameter names, such as WP_SPEED, to numbers",
    lambda v: (
        isinstance(v, Mapping)
        and all(re.fullmatch(r"[A-Z][A-Z0-9_]{0,15}", str(name)) for name in v)
        and all(map(checks.is_number, v.values()))
    ),
)
OCTANTS = 8  # number of horizontal range finder directions, clockwise from straight ahead
AXES = ("POS_X", "POS_Y", "POS_Z")  # position [m] in the body frame: forward, right, down
ORIENTATION = "ORIENT"
LIMITS = ("MIN", "MAX")
MAX_RANGE_FINDERS = 6  # maximum number of range finders in ArduPilot's JSON backend
SIMULATED = 100  # type number of a simulated range finder
EVEN_THROTTLE = 50
DEFAULT_GAIN, GREATEST_GAIN = 1.0, 6.0  # default and maximum velocity gain of ArduPilot


def derive_parameters(briefing: Briefing, given: Mapping[str, Any]) -> dict[str, float]:
    """Return the parameters derived from the robot and the mission, except ``given`` ones."""
    drive = briefing.robot.drive
    speed = float(given.get("WP_SPEED", drive.max_speed_mps))
    if speed <= 0.0:
        raise InputError(
            f"controller.parameters.WP_SPEED: must be greater than 0, not {speed:g}; set the "
            f"route speed [m/s], for example 0.3"
        )
    curvature = drive.turn_ratio * elementary.tan(drive.steering_limit) / drive.wheelbase_m
    derived = {
        "WP_SPEED": speed,
        # speed is proportional to throttle, up to the maximum speed at full throttle
        "CRUISE_SPEED": drive.max_speed_mps * EVEN_THROTTLE / 100,
        "CRUISE_THROTTLE": EVEN_THROTTLE,
        "WP_RADIUS": 0.5 * briefing.acceptance_m,
        "TURN_RADIUS": 1.0 / curvature,
        # fraction of full lock per turn rate; ArduPilot's default, 0.2, is too low for slow robots
        "ATC_STR_RAT_FF": 1.0 / (speed * curvature),
        # ArduPilot divides the lateral acceleration by at least 1 m/s, even for slower robots.
        "PSC_VEL_P": min(max(1.0 / speed, DEFAULT_GAIN), GREATEST_GAIN),
        **dict(_describe_range_finders(briefing.robot)),
    }
    return {name: value for name, value in derived.items() if name not in given}


def list_range_finders(robot: Robot) -> list[tuple[int, RangeSensor]]:
    """List the first (mount, sensor) pairs with a single range, which the autopilot receives."""
    return [
        (mount, sensor)
        for mount, sensor in enumerate(robot.mounted_sensors())
        if sees(sensor) and len(sensor.channels) == 1
    ][:MAX_RANGE_FINDERS]


def _describe_range_finders(robot: Robot) -> Iterator[tuple[str, float]]:
    poses = robot.sensor_poses.tolist()
    for index, (mount, sensor) in enumerate(list_range_finders(robot), 1):
        instance, (x, y, z, yaw, _) = str(index), poses[mount]
        yield name_parameter(instance, "TYPE"), SIMULATED
        yield name_parameter(instance, ORIENTATION), count_octants(yaw) % OCTANTS
        for axis, value in zip(AXES, to_body((x, y, z)), strict=True):
            yield name_parameter(instance, axis), value
        for limit, value in zip(LIMITS, (sensor.range_min_m, sensor.range_max_m), strict=True):
            yield name_parameter(instance, name_limit(limit, metres=True)), value
            yield name_parameter(instance, name_limit(limit, metres=False)), 100.0 * value


def write_parameters(parameters: Mapping[str, float]) -> str:
    """Return the content of an ArduPilot parameter file."""
    return "".join(f"{name} {float(value):.9g}\n" for name, value in parameters.items())


def name_parameter(instance: str, quantity: str) -> str:
    """Return the name of a range finder's parameter; range finders are numbered 1 to 9, A."""
    return f"RNGFND{instance}_{quantity}"


def name_limit(limit: str, metres: bool) -> str:
    """Return the name of a range limit's parameter; ArduPilot up to 4.6 uses centimetres."""
    return limit if metres else f"{limit}_CM"


def to_body(position_m: tuple[float, float, float]) -> tuple[float, float, float]:
    """Convert a position (forward, left, up) to the body frame (forward, right, down)."""
    x, y, z = position_m
    return x, -y, -z


def count_octants(yaw_rad: float) -> int:
    """Return the number of clockwise eighths of a turn closest to a yaw [rad]."""
    return round(-yaw_rad / (2.0 * math.pi) * OCTANTS)


@dataclass(frozen=True, kw_only=True)
@checks.checked
class ArduPilotSettings(LiveController):
    """Settings of the ``ArduPilot`` controller, with checks of consistency."""

    binary: Annotated[str, checks.TEXT]
    avoidance: Annotated[Layer, checks.instance_of(Layer, "a controller layer")]
    period_s: Annotated[float, PERIOD] = _MAX_PERIOD_S  # time between state messages
    avoidance_period_s: Annotated[float, checks.POSITIVE] = 0.1
    localization: Annotated[Mapping[str, Localizer], LOCALIZATION] = field(default_factory=dict)
    parameters: Annotated[Mapping[str, float], _PARAMETERS] = field(default_factory=dict)
    arguments: Annotated[Sequence[str], checks.sequence_of(str, "strings")] = ()
    environment: Annotated[Mapping[str, str], checks.mapping_of(str, "strings")] = field(
        default_factory=dict
    )
    warm_up_s: Annotated[float, checks.POSITIVE] = 60.0  # simulated time limit for mode AUTO
    start_limit_s: Annotated[float, checks.POSITIVE] = 30.0  # wall-clock time
    answer_limit_s: Annotated[float, checks.POSITIVE] = 10.0  # wall-clock time
    isolate: Annotated[bool, checks.FLAG] = True
    share_core: Annotated[bool, checks.FLAG] = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "binary", split_command([self.binary])[0])
        if self.localization:
            rule = "must be empty (the autopilot estimates the pose itself)"
            fix = "choose controller/localization=exact"
            raise checks.invalid(self, "localization", list(self.localization), rule, fix)
        period, count = self.avoidance_period_s, round(self.avoidance_period_s / self.period_s)
        if count < 1 or abs(count * self.period_s - period) > 1e-9:
            rule = f"must be a whole multiple of period_s ({self.period_s:g} s)"
            fix = f"set it to {max(1, count) * self.period_s:g}"
            raise checks.invalid(self, "avoidance_period_s", period, rule, fix)
