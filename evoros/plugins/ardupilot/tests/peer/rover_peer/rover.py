"""The vehicle: modes, arming, the route, the radio's channels and the servos."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from .backend import State

MANUAL, HOLD, AUTO, GUIDED = 0, 4, 10, 15
MODES = (MANUAL, HOLD, AUTO, GUIDED)
STEERING, THROTTLE = 1, 3
METRES_PER_DEGREE = 111318.84502145034
READY_S, ACCELS_S, POSITION_S = 1.0, 3.0, 5.0
"""When it has started, when its accelerometers agree, when it has a position [s]."""
GYRO_RATIO = 1.8
SITL_RANGE_FINDER = 100


@dataclass
class Rover:
    """The state that frames and messages change."""

    parameters: Mapping[str, float]
    home: tuple[float, float]
    say: Callable[[str], None] = print
    mode: int = MANUAL
    armed: bool = False
    ready: bool = False
    time: float = 0.0
    step: float = 0.0
    route: list[tuple[float, float]] = field(default_factory=list)  # north, east [m]; item 0: home
    target: int = 1
    begun: bool = False
    origin: tuple[float, float] = (0.0, 0.0)  # where the leg to the target began
    overrides: dict[int, tuple[int, float]] = field(default_factory=dict)  # channel: width, time
    heard: float = -1.0  # when the ground station was last heard [s]

    def set_route(self, items: list[tuple[float, float]]) -> None:
        """Take a route of latitudes and longitudes [deg]."""
        lat0, lon0 = self.home
        scale = METRES_PER_DEGREE * math.cos(math.radians(lat0))
        self.route = [
            ((lat - lat0) * METRES_PER_DEGREE, (lon - lon0) * scale) for lat, lon in items
        ]
        self.begun = False

    def set_mode(self, mode: int, state: State) -> bool:
        """Change the mode, if it is allowed."""
        if mode not in MODES:
            return False
        if mode == AUTO:
            if len(self.route) < 2:
                self.say("No Mission. Can't set AUTO.")
                return False
            if self.armed and self.time < POSITION_S:
                self.say("Mode change to AUTO failed: requires position")
                return False
            if not self.begun or self.parameters["MIS_RESTART"]:
                self.target, self.begun = 1, True
            self.origin = (state.position[0], state.position[1])
        self.mode = mode
        return True

    def arm(self, state: State) -> bool:
        """Arm, if nothing is against it."""
        reason = self.reason_not_to_arm(state)
        if reason:
            self.say(f"Arm: {reason}")
            return False
        self.armed = True
        self.say("Throttle armed")
        return True

    def reason_not_to_arm(self, state: State) -> str:
        """Return what is against arming, in the words of the original."""
        loop = self.parameters["SCHED_LOOP_RATE"]
        rate = round(1.0 / self.step) if self.step > 0.0 else 0
        if not self.ready:
            return "System not initialised"
        if rate < loop:
            return f"Main loop slow ({rate}Hz < {loop:.0f}Hz)"
        if loop > 50 and rate < GYRO_RATIO * loop:
            return f"Gyro 0 rate {rate}Hz < loop rate*1.8 {GYRO_RATIO * loop:.0f}Hz"
        if self.parameters["FRAME_CLASS"] not in (1, 2, 3):
            return "Motors: Check FRAME_CLASS and FRAME_TYPE"
        if (self.parameters["SERVO1_FUNCTION"], self.parameters["SERVO3_FUNCTION"]) != (26, 70):
            return "check steering and throttle config"
        for i, distance in enumerate(state.ranges, start=1):
            if self.parameters[f"RNGFND{i}_TYPE"] == SITL_RANGE_FINDER and math.isnan(distance):
                return f"Rangefinder {i}: No Data"
        return "Accels inconsistent" if self.time < ACCELS_S else ""

    def update(self, time: float, step: float, state: State) -> None:
        """Do what a frame brings."""
        self.time, self.step = time, step
        if not self.ready and time > READY_S:
            self.ready = True
            self.say("ArduPilot Ready")
        silent = self.heard >= 0.0 and time - self.heard > self.parameters["FS_TIMEOUT"]
        if silent and self.parameters["FS_GCS_ENABLE"] == 1 and self.mode != HOLD:
            self.say("GCS Failsafe")
            self.mode = HOLD
        if self.armed and self.mode == AUTO and self.target < len(self.route):
            self._check_waypoint(state)

    def _check_waypoint(self, state: State) -> None:
        """Count the waypoint within its radius, or past the line across the leg's end."""
        north, east = self.route[self.target]
        to_go = (north - state.position[0], east - state.position[1])
        leg = (north - self.origin[0], east - self.origin[1])
        near = math.hypot(*to_go) <= self.parameters["WP_RADIUS"]
        if near or to_go[0] * leg[0] + to_go[1] * leg[1] <= 0.0:
            self.say(f"Reached waypoint #{self.target}")
            self.origin = (north, east)
            self.target += 1
            if self.target == len(self.route):
                self.say("Mission Complete")

    def servos(self, state: State) -> list[int]:
        """Return the widths of the 16 servo outputs [us]."""
        outputs = [0] * 16
        if self.ready:
            steering, throttle = self._demand(state) if self.armed else (0.0, 0.0)
            outputs[STEERING - 1] = self._width(STEERING, steering)
            outputs[THROTTLE - 1] = self._width(THROTTLE, throttle)
        return outputs

    def _demand(self, state: State) -> tuple[float, float]:
        """Return steering, to the right, and throttle, both from -1 to 1."""
        if self.mode == MANUAL:
            return int(4500 * self._input(STEERING)) / 4500, int(100 * self._input(THROTTLE)) / 100
        if self.mode != AUTO or self.target >= len(self.route):
            return 0.0, 0.0
        north, east = self.route[self.target]
        bearing = math.atan2(east - state.position[1], north - state.position[0])
        error = math.remainder(bearing - state.attitude[2], 2.0 * math.pi)
        value = self.parameters
        aside = math.sin(max(-0.5 * math.pi, min(error, 0.5 * math.pi)))
        # As the original, it takes the lateral acceleration for a rate at 1 m/s at least.
        rate = value["PSC_VEL_P"] * value["WP_SPEED"] * aside / max(value["WP_SPEED"], 1.0)
        throttle = value["WP_SPEED"] / value["CRUISE_SPEED"] * int(value["CRUISE_THROTTLE"]) / 100
        return value["ATC_STR_RAT_FF"] * rate, throttle

    def _input(self, channel: int) -> float:
        """Return what a channel of the radio demands, from -1 to 1."""
        value = self.parameters
        width, told = self.overrides.get(channel, (0, 0.0))
        lasts = value["RC_OVERRIDE_TIME"]
        if width == 0 or (0 <= lasts < self.time - told):
            return 0.0
        trim = value[f"RC{channel}_TRIM"]
        if abs(width - trim) <= value[f"RC{channel}_DZ"]:
            return 0.0
        end = value[f"RC{channel}_MAX"] if width > trim else value[f"RC{channel}_MIN"]
        return max(-1.0, min(1.0, (width - trim) / abs(end - trim)))

    def _width(self, servo: int, demand: float) -> int:
        trim = self.parameters[f"SERVO{servo}_TRIM"]
        end = self.parameters[f"SERVO{servo}_{'MAX' if demand > 0 else 'MIN'}"]
        return int(trim + min(abs(demand), 1.0) * (end - trim))
