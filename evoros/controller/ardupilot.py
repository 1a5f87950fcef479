"""A real ArduPilot Rover as the controller: its simulation (SITL), in lock-step with ours.

As in the 2018 paper on Evo-ROS, the autopilot drives the route in its mode AUTO; while an avoidance
layer sees an obstacle, that layer drives through MANUAL, in the place of the radio.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

from evoros.base.checks import (
    FLAG,
    POSITIVE,
    TEXT,
    Rule,
    checked,
    instance_of,
    invalid,
    is_number,
    mapping_of,
    sequence_of,
)
from evoros.bridge.mavlink import GroundStation, accept, dialect
from evoros.bridge.process import start_process
from evoros.controller.ardupilot_parameters import (
    MAX_RANGE_FINDERS,
    derive_parameters,
    write_parameters,
)
from evoros.controller.ardupilot_pilot import HOME, ArduPilotPilot
from evoros.controller.line_controller import split_command
from evoros.controller.protocol import LOCALIZATION, Briefing, Layer, Localizer, Pilot

MAX_PERIOD_S = 0.02
PARAMETERS_FILE = "evoros.parm"
SOCKETS = {"servos": "udp", "mavlink": "tcp", "radio": "port"}
START_TIME = 1_500_000_000  # of its clock; any, but always the same
NO_LIMIT = 1000  # of the pace, by the wall clock

PERIOD = Rule(
    f"a number greater than 0 and at most {MAX_PERIOD_S}, because ArduPilot does not arm with "
    f"fewer than 50 states a second",
    lambda v: is_number(v) and 0 < v <= MAX_PERIOD_S + 1e-12,
)
PARAMETERS = Rule(
    "a mapping from ArduPilot's names, such as WP_SPEED, to numbers",
    lambda v: (
        isinstance(v, Mapping)
        and all(re.fullmatch(r"[A-Z][A-Z0-9_]{0,15}", str(name)) for name in v)
        and all(map(is_number, v.values()))
    ),
)


@dataclass(frozen=True, kw_only=True)
@checked
class ArduPilot:
    """Starts ``binary``, an ardurover for the simulation, for each mission.

    The autopilot has its route before the mission begins, is armed and in AUTO. docs/ardupilot.md
    describes what it is told and what its outputs mean.

    Raises:
        InputError: a value breaks its rule.
    """

    binary: Annotated[str, TEXT]
    avoidance: Annotated[Layer, instance_of(Layer, "a layer of a controller")]
    period_s: Annotated[float, PERIOD] = MAX_PERIOD_S  # between two states
    avoidance_period_s: Annotated[float, POSITIVE] = 0.1
    localization: Annotated[Mapping[str, Localizer], LOCALIZATION] = field(default_factory=dict)
    parameters: Annotated[Mapping[str, float], PARAMETERS] = field(default_factory=dict)
    arguments: Annotated[Sequence[str], sequence_of(str, "texts")] = ()
    environment: Annotated[Mapping[str, str], mapping_of(str, "texts")] = field(
        default_factory=dict
    )
    warm_up_s: Annotated[float, POSITIVE] = 60.0  # simulated, until it is in AUTO
    start_limit_s: Annotated[float, POSITIVE] = 30.0  # wall clock
    answer_limit_s: Annotated[float, POSITIVE] = 10.0  # wall clock
    isolate: Annotated[bool, FLAG] = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "binary", split_command([self.binary])[0])
        if self.localization:
            raise invalid(
                self,
                "localization",
                list(self.localization),
                "must be empty, because the autopilot has a localization of its own",
                "choose controller/localization=exact",
            )
        count = round(self.avoidance_period_s / self.period_s)
        if count < 1 or abs(count * self.period_s - self.avoidance_period_s) > 1e-9:
            raise invalid(
                self,
                "avoidance_period_s",
                self.avoidance_period_s,
                f"must be a whole multiple of period_s ({self.period_s:g} s)",
                f"set it to {max(1, count) * self.period_s:g}",
            )

    @property
    def modes(self) -> tuple[str, str]:
        """What it does: the mode of its avoidance, and ``navigating`` in AUTO."""
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
        """What the binary says of its version, for example ``ArduRover V4.5.7 (1a2b3c4d)``."""
        try:
            content = Path(self.binary).read_bytes()
        except OSError:
            return ""
        found = re.search(rb"ArduRover V[ -~]{1,60}", content)
        return found[0].decode() if found else ""

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
