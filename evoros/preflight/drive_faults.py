"""Describes where a robot's motion differs from the commanded one."""

import math
from collections.abc import Mapping

from evoros.drive.protocol import Drive
from evoros.drive.wheels import skids
from evoros.preflight.trial_drive import BACK, STRAIGHT, TURNS, Manoeuvre, Rest, TrialDrive

TOLERANCE = 0.05  # as a share of the commanded motion
SKIDDING_TOLERANCE = 0.1
"""The tolerance of turns on wheels that slip. Their turning resistance assumes equal loads on
wheels that touch the ground in a point."""
MAX_SUNK_M, MAX_TILT_DEG = 0.01, 5.0
ALIKE = 0.05  # maximum difference of deviations that are reported as one


def describe(trial: TrialDrive, drive: Drive, speed: float) -> str:
    """Return the faults of a robot's motion at a speed [m/s]; an empty text if none."""
    if not all(map(math.isfinite, (*trial.rest, *trial.shares.values()))):
        return "has a pose that is no number"
    faults = [*describe_rest(trial.rest, speed), *describe_shares(trial.shares, drive)]
    return " and ".join(faults)


def describe_rest(rest: Rest, speed: float) -> list[str]:
    """Return the faults of a robot at rest."""
    faults = []
    if not rest.tilt_deg <= MAX_TILT_DEG:
        faults.append(f"stands at a tilt of {rest.tilt_deg:.0f} deg")
    if not rest.sunk_m <= MAX_SUNK_M:
        faults.append(f"sinks {1e3 * rest.sunk_m:.0f} mm into the ground")
    if not rest.drift_mps <= TOLERANCE * speed:
        faults.append(f"drifts {1e3 * rest.drift_mps:.0f} mm/s at rest")
    return faults


def describe_shares(shares: Mapping[Manoeuvre, float], drive: Drive) -> list[str]:
    """Return which of some manoeuvres a robot does not drive as commanded."""
    wrong = {
        manoeuvre: share - 1.0
        for manoeuvre, share in shares.items()
        if not abs(share - 1.0) <= find_tolerance(manoeuvre, drive)
    }
    faults = []
    if STRAIGHT in wrong and BACK in wrong and abs(wrong[STRAIGHT] - wrong[BACK]) < ALIKE:
        faults.append(_compare("drives", wrong[STRAIGHT]))
    else:
        names = ((STRAIGHT, "drives ahead"), (BACK, "drives back"))
        faults += [_compare(verb, wrong[move]) for move, verb in names if move in wrong]
    return faults + _describe_turns({move: wrong[move] for move in TURNS if move in wrong})


def find_tolerance(manoeuvre: Manoeuvre, drive: Drive) -> float:
    """Return how far a share may be from 1."""
    return SKIDDING_TOLERANCE if manoeuvre.lock and skids(drive) else TOLERANCE


def _describe_turns(wrong: Mapping[Manoeuvre, float]) -> list[str]:
    deviations = list(wrong.values())
    if len(wrong) == len(TURNS) and (
        max(deviations) - min(deviations) < ALIKE or max(deviations) < -0.9
    ):
        return [_compare("turns", deviations[-1])]
    parts = [f"{_compare('turns', wrong[move])} at {move.name}" for move in wrong]
    shortened = [part.replace("turns ", "").replace(" than commanded", "") for part in parts[1:]]
    return [", ".join([*parts[:1], *shortened])] if parts else []


def _compare(verb: str, deviation: float) -> str:
    if deviation < -1.1:
        return f"{verb} the other way"
    if deviation < -0.9:
        return f"hardly {verb} at all"
    direction = "faster" if deviation > 0 else "slower"
    return f"{verb} {100 * abs(deviation):.0f} % {direction} than commanded"
