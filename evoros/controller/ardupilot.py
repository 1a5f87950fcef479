"""A real ArduPilot Rover as the controller: its simulation (SITL), in lock-step with ours.

As in the 2018 paper on Evo-ROS, the autopilot drives the route in its mode AUTO; while an avoidance
layer sees an obstacle, that layer drives through MANUAL, in the place of the radio.
"""

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from evoros.bridge.cores import share_core
from evoros.bridge.mavlink import GroundStation, accept, dialect
from evoros.bridge.process import start_process
from evoros.controller.ardupilot_parameters import (
    MAX_RANGE_FINDERS,
    derive_parameters,
    write_parameters,
)
from evoros.controller.ardupilot_pilot import HOME, ArduPilotPilot
from evoros.controller.ardupilot_settings import ArduPilotSettings
from evoros.controller.protocol import Briefing, Pilot

PARAMETERS_FILE = "evoros.parm"
SOCKETS = {"servos": "udp", "mavlink": "tcp", "radio": "port"}
START_TIME = 1_500_000_000  # of its clock; any, but always the same
NO_LIMIT = 1000  # of the pace, by the wall clock


@dataclass(frozen=True, kw_only=True)
class ArduPilot(ArduPilotSettings):
    """Starts ``binary``, an ardurover for the simulation, for each mission.

    The autopilot has its route before the mission begins, is armed and in AUTO. docs/ardupilot.md
    describes its inputs and outputs.
    """

    @property
    def modes(self) -> tuple[str, str]:
        """The mode of its avoidance, and ``navigating`` in AUTO."""
        return self.avoidance.mode, "navigating"

    @property
    def files(self) -> tuple[str, ...]:
        """The binary."""
        return (self.binary,)

    @property
    def told_sensors(self) -> int:
        """The number of range finders of the simulation."""
        return MAX_RANGE_FINDERS

    @property
    def version(self) -> str:
        """The version in the binary, for example ``ArduRover V4.5.7 (1a2b3c4d)``."""
        try:
            content = Path(self.binary).read_bytes()
        except OSError:
            return ""
        version = re.search(rb"ArduRover V[ -~]{1,60}", content)
        return version[0].decode() if version else ""

    @contextmanager
    def launch(self, briefing: Briefing) -> Iterator[Pilot]:
        """Start the autopilot for one mission, and bring it into AUTO.

        Raises:
            LaunchError: it cannot be started.
            InputError: it does not arm, or refuses its route or a parameter.
            PilotLost: it ended, or did not answer in time.
        """
        dialect()
        parameters = derive_parameters(briefing, self.parameters) | dict(self.parameters)
        starting = start_process(
            self._command(),
            isolate=self.isolate,
            environment=self.environment,
            sockets=SOCKETS,
            files={PARAMETERS_FILE: write_parameters(parameters)},
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
