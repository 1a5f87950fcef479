"""The command line and the parameters."""

import argparse
import re
from collections.abc import Mapping
from pathlib import Path

DEFAULTS: Mapping[str, float] = {
    "AHRS_EKF_TYPE": 3,
    "ATC_STR_RAT_FF": 0.2,
    "CRUISE_SPEED": 2,
    "CRUISE_THROTTLE": 50,
    "FRAME_CLASS": 0,
    "FS_ACTION": 2,
    "FS_CRASH_CHECK": 0,
    "FS_EKF_ACTION": 1,
    "FS_GCS_ENABLE": 0,
    "FS_THR_ENABLE": 1,
    "FS_TIMEOUT": 1.5,
    "LOG_BACKEND_TYPE": 1,
    "LOG_DISARMED": 0,
    "MIS_DONE_BEHAVE": 0,
    "MIS_RESTART": 0,
    "MOT_SLEWRATE": 100,
    "PSC_VEL_P": 1,
    "RC_OVERRIDE_TIME": 3,
    "SCHED_LOOP_RATE": 50,
    "TURN_RADIUS": 0.9,
    "WP_RADIUS": 2,
    "WP_SPEED": 2,
    **{f"RC{n}_{key}": value for n in (1, 3) for key, value in {"DZ": 30, "TRIM": 1500}.items()},
    **{f"RC{n}_{key}": value for n in (1, 3) for key, value in {"MIN": 1100, "MAX": 1900}.items()},
    **{f"SERVO{n}_FUNCTION": 0 for n in (1, 3)},
    **{
        f"SERVO{n}_{key}": value
        for n in (1, 3)
        for key, value in {"MIN": 1100, "MAX": 1900}.items()
    },
    **{f"SERVO{n}_TRIM": 1500 for n in (1, 3)},
    **{f"RNGFND{n}_TYPE": 0 for n in range(1, 7)},
    **{f"RNGFND{n}_{key}": 0 for n in range(1, 7) for key in ("ORIENT", "POS_X", "POS_Y", "POS_Z")},
    **{f"RNGFND{n}_MIN_CM": 20 for n in range(1, 7)},
    **{f"RNGFND{n}_MAX_CM": 700 for n in range(1, 7)},
}
"""The parameters that it knows; of the range finders' limits, the names until 4.6."""


def read_options() -> argparse.Namespace:
    """Read the command line, with the options that a client may need."""
    parser = argparse.ArgumentParser(prog="ardurover", allow_abbrev=False)
    parser.add_argument("--model", "-M")
    parser.add_argument("--speedup", "-s", type=float, default=1.0)
    parser.add_argument("--wipe", "-w", action="store_true")
    parser.add_argument("--home", "-O", default="-35.363261,149.165230,584,353")
    parser.add_argument("--defaults", default="")
    parser.add_argument("--start-time", type=int)
    parser.add_argument("--sim-address", default="127.0.0.1")
    parser.add_argument("--sim-port-in", type=int, default=9003)
    parser.add_argument("--sim-port-out", type=int, default=9002)
    parser.add_argument("--rc-in-port", type=int, default=5501)
    for number in range(10):
        parser.add_argument(f"--serial{number}", default="")
    options = parser.parse_args()
    if not str(options.model).lower().startswith("json"):
        parser.exit(1, "You must specify a vehicle model.\n")
    if options.speedup <= 0:
        parser.exit(134, "Aborted: SIM_SPEEDUP must be positive\n")
    return options


def read_parameters(files: str) -> dict[str, float]:
    """Read the files, which commas separate; of a parameter the last value counts."""
    parameters = dict(DEFAULTS)
    for file in filter(None, files.split(",")):
        for line in Path(file).read_text().splitlines():
            words = re.split(r"[, =\t]+", line.strip())
            if line.startswith("#") or len(words) < 2:
                continue
            if words[0] in DEFAULTS:
                parameters[words[0]] = float(words[1])
    return parameters
