"""The ArduPilot Rover firmware (SITL) as a controller, in lock-step with the mission.

The autopilot drives in mode AUTO; while an avoidance layer sees an obstacle, the autopilot follows
the layer's commands in mode MANUAL.
"""

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from evoros.base import elementary
from evoros.base.arrays import COMMAND_SIZE, DRIVE_SPEED, STEERING, Array
from evoros.base.errors import InputError
from evoros.base.rng import generator
from evoros.bridge.process import OutsideProcess, start_process
from evoros.compilation.named_rules import start_rule
from evoros.compilation.rules import LAYER, compile_if_possible
from evoros.controller import ardupilot_parameters
from evoros.controller.protocol import LAYER_ARGUMENTS, Briefing, Pilot
from evoros.plugins.ardupilot.mavlink import RELEASED, GroundStation, accept, dialect
from evoros.plugins.ardupilot.sitl import NO_PULSE, SitlFrames, share_core

HOME = (42.0, -83.0)  # latitude and longitude [deg] of the world's origin; x points north
METRES_PER_DEGREE = 111318.84502145034  # length of a degree along a meridian, as in ArduPilot
MANUAL, AUTO = 0, 10
CENTRE_US, SPAN_US = 1500, 500
STEERING_SERVO, THROTTLE_SERVO = 0, 2
AVOIDING, NAVIGATING = 1, 2
BEYOND_M = 1.0  # distance [m] past its range that a silent sonar reports, to clear the last value
ASKED_AT_ONCE, ANSWER_S = 5, 2.0  # parameters per request, and simulated time limit for answers


class ArduPilotPilot:
    """The autopilot, and the avoidance layer that can override it."""

    def __init__(
        self,
        settings: ardupilot_parameters.ArduPilotSettings,
        briefing: Briefing,
        process: OutsideProcess,
        station: GroundStation,
    ) -> None:
        robot, drive = briefing.robot, briefing.robot.drive
        self._settings, self._briefing, self.period_s = settings, briefing, settings.period_s
        self._process, self._station = process, station
        self._full_speed, self._full_lock = drive.max_speed_mps, drive.steering_limit
        finders = ardupilot_parameters.list_range_finders(robot)
        self._nothing_seen = [float(sensor.range_max_m) for _, sensor in finders]
        # Index of the reading of each range finder, and the value to report if it is silent.
        self._finders = [
            (robot.layout[mount].start, limit + BEYOND_M)
            for (mount, _), limit in zip(finders, self._nothing_seen, strict=True)
        ]
        servos = process.sockets["servos"]
        self._frames = SitlFrames(process, servos, -drive.rear_axle_x_m, len(finders))
        x, y, _, yaw = map(float, briefing.home)
        self._at_home = (x, y, yaw)
        self._frame = 0  # number of states sent
        self._tick = 0  # number of decisions
        self._second = max(1, round(1.0 / settings.period_s))
        self._avoid_every = round(settings.avoidance_period_s / settings.period_s)
        rng = generator(str(briefing.seed), "avoidance")
        avoidance, period = settings.avoidance, settings.avoidance_period_s
        bound = start_rule(avoidance.rule, LAYER_ARGUMENTS, avoidance.start, robot, period, rng)
        self._rule = bound._replace(rule=compile_if_possible(bound.rule, LAYER))
        self._wish = np.zeros(COMMAND_SIZE)
        self._radio = (RELEASED, RELEASED)
        self._avoiding = False

    def warm_up(self) -> None:
        """Bring the autopilot into mode AUTO, at rest at home with no obstacle in sight."""
        station, settings = self._station, self._settings
        self._frames.connect(settings.start_limit_s)
        self._frames.receive(settings.start_limit_s, None)
        self._wait("send a heartbeat", lambda: station.mode is not None)
        self._wait("report that it is ready", lambda: station.ready)
        self._check_parameters()
        station.stop_streams()
        station.send_route(list(self._convert_route()))
        self._wait("acknowledge its route", lambda: station.route_result is not None)
        if station.route_result != 0:
            raise self._refused(f"accept the route (MAV_MISSION_RESULT {station.route_result})")
        self._wait("arm", station.has_armed, station.arm)
        self._wait("enter AUTO", station.has_set_mode, lambda: station.set_mode(AUTO))

    def exchange(
        self, time: float, state: Array, leg: Array, readings: Array, command: Array
    ) -> int:
        """Exchange messages while the autopilot waits; send the state, and read servo outputs."""
        if self._tick % self._second == 0:
            self._station.send_heartbeat()
        if self._tick % self._avoid_every == 0:
            self._station.read(time)  # only the avoidance layer reads these messages
            self._avoid(time, state, leg, readings)
        self._tick += 1
        x, y, yaw, speed, rate, _ = state.tolist()
        seen = readings.tolist()
        told = [(seen[place], silent) for place, silent in self._finders]
        ranges = [value if value == value else silent for value, silent in told]
        widths = self._advance((x, y, yaw), (speed, rate), ranges, time)
        steering, throttle = widths[STEERING_SERVO], widths[THROTTLE_SERVO]
        self._frames.check_widths((steering, throttle), time)
        if NO_PULSE in (steering, throttle):
            return 0
        command[STEERING] = (CENTRE_US - steering) / SPAN_US * self._full_lock
        command[DRIVE_SPEED] = (throttle - CENTRE_US) / SPAN_US * self._full_speed
        return AVOIDING if self._avoiding else NAVIGATING

    def _avoid(self, time: float, state: Array, leg: Array, readings: Array) -> None:
        station, wish = self._station, self._wish
        avoiding = bool(self._rule(state, leg, readings, time, wish))
        if avoiding != self._avoiding or not station.has_set_mode():
            station.set_mode(MANUAL if avoiding else AUTO)
        self._avoiding = avoiding
        radio = (RELEASED, RELEASED)
        if avoiding:
            steering = _to_width(-float(wish[STEERING]) / self._full_lock)
            radio = (steering, _to_width(float(wish[DRIVE_SPEED]) / self._full_speed))
        if radio != self._radio or (avoiding and self._tick % self._second == 0):
            station.override_radio(*radio)
        self._radio = radio

    def _advance(
        self,
        pose: Sequence[float],
        motion: Sequence[float],
        ranges: Sequence[float],
        time: float | None,
    ) -> tuple[int, ...]:
        self._frame += 1
        clock = self._frame * self.period_s
        self._frames.send(clock, self.period_s, pose, motion, ranges)
        return self._frames.receive(self._settings.answer_limit_s, time)

    def rest(self) -> None:
        """Simulate one frame with the robot at rest at home."""
        self._advance(self._at_home, (0.0, 0.0), self._nothing_seen, None)
        self._station.read(None)

    def _wait(
        self, what: str, is_done: Callable[[], bool], ask: Callable[[], None] | None = None
    ) -> None:
        """Keep the robot at rest until ``is_done()``, and call ``ask`` every simulated second."""
        for frame in range(math.ceil(self._settings.warm_up_s / self.period_s)):
            if frame % self._second == 0:
                self._station.send_heartbeat()
                if ask is not None:
                    ask()
            self.rest()
            if is_done():
                return
        raise self._refused(f"{what} within {self._settings.warm_up_s:g} simulated s")

    def _refused(self, what: str) -> InputError:
        texts = "; ".join(self._station.texts) or "nothing"
        return InputError(
            f"{self._process.name} did not {what}; its last messages: {texts}; check the "
            f"binary and controller.parameters"
        )

    def _check_parameters(self) -> None:
        """Check that the autopilot knows all given parameters; it ignores unknown parameters."""
        station, names = self._station, list(self._settings.parameters)
        for first in range(0, len(names), ASKED_AT_ONCE):
            asked = names[first : first + ASKED_AT_ONCE]
            for name in asked:
                station.ask_parameter(name)
            for _ in range(math.ceil(ANSWER_S / self.period_s)):
                if station.parameters.keys() >= set(asked):
                    break
                self.rest()
            unknown = [name for name in asked if name not in station.parameters]
            if unknown and station.parameters:
                raise InputError(
                    f"controller.parameters.{unknown[0]}: not a parameter of this version of "
                    f"{self._process.name}; rename or remove it"
                )
            if unknown:
                return

    def _convert_route(self) -> Sequence[tuple[float, float]]:
        latitude, longitude = HOME
        scale = METRES_PER_DEGREE * elementary.cos(math.radians(latitude))
        points = [self._briefing.home[:2], *self._briefing.route.tolist()]
        return [(latitude + x / METRES_PER_DEGREE, longitude - y / scale) for x, y in points]


def _to_width(demand: float) -> int:
    return CENTRE_US + round(SPAN_US * max(-1.0, min(demand, 1.0)))


PARAMETERS_FILE = "evoros.parm"
SOCKETS = {"servos": "udp", "mavlink": "tcp", "radio": "port"}
START_TIME = 1_500_000_000  # initial time [s] of the autopilot's clock, arbitrary
NO_LIMIT = 1000  # maximum ratio of simulated to real time, never reached


@dataclass(frozen=True, kw_only=True)
class ArduPilot(ardupilot_parameters.ArduPilotSettings):
    """A controller that runs ``binary``, an ardurover built for simulation, in each mission.

    Missions start armed, in mode AUTO, with the route; README.md describes inputs and outputs.
    """

    @property
    def modes(self) -> tuple[str, str]:
        """The modes: the avoidance layer's, and ``navigating`` for AUTO."""
        return self.avoidance.mode, "navigating"

    @property
    def files(self) -> tuple[str, ...]:
        """The path of the binary."""
        return (self.binary,)

    @property
    def told_sensors(self) -> int:
        """The maximum number of sensors that the autopilot can use."""
        return ardupilot_parameters.MAX_RANGE_FINDERS

    @property
    def version(self) -> str:
        """The version string in the binary, such as ``ArduRover V4.5.7 (1a2b3c4d)``."""
        try:
            content = Path(self.binary).read_bytes()
        except OSError:
            return ""
        version = re.search(rb"ArduRover V[ -~]{1,60}", content)
        return version[0].decode() if version else ""

    @contextmanager
    def launch(self, briefing: Briefing) -> Iterator[Pilot]:
        """Start the autopilot for one mission, and bring it into mode AUTO."""
        dialect()
        derived = ardupilot_parameters.derive_parameters(briefing, self.parameters)
        written = ardupilot_parameters.write_parameters({**derived, **self.parameters})
        starting = start_process(
            self._command(),
            isolate=self.isolate,
            environment=self.environment,
            sockets=SOCKETS,
            files={PARAMETERS_FILE: written},
        )
        with (
            share_core(wanted=self.share_core),
            starting as process,
            accept(process, process.sockets["mavlink"], self.start_limit_s) as connection,
        ):
            pilot = ArduPilotPilot(self, briefing, process, GroundStation(process, connection))
            pilot.warm_up()
            yield pilot

    def _command(self) -> list[str]:
        latitude, longitude = HOME
        options: Mapping[str, Any] = {
            "--model": "JSON",
            "--speedup": NO_LIMIT,
            "--sim-port-out": "{servos}",
            "--serial0": "tcpclient:127.0.0.1:{mavlink}",
            "--serial1": "none:",
            "--serial2": "none:",
            "--rc-in-port": "{radio}",
            "--home": f"{latitude},{longitude},0,0",
            "--defaults": PARAMETERS_FILE,
            "--start-time": START_TIME,
        }
        words = [str(word) for option in options.items() for word in option]
        return [self.binary, "--wipe", *words, *self.arguments]
