"""Draws the faults of a mission, and checks them."""

from collections.abc import Callable

import numpy as np
from numpy.random import Generator

from evoros.base.errors import InputError
from evoros.failure.case import Case
from evoros.failure.protocol import (
    Failure,
    Fault,
    StatedFailure,
    SystematicFailure,
    list_parts,
    make_faults,
)
from evoros.filter.protocol import READINGS, SIGNALS, Channels
from evoros.robot.model import Robot

Draws = Callable[[str], Generator]
"""Creates the generator of a named part in one mission."""


def describe_sensors(robot: Robot) -> Channels:
    """Describe the sensors to failures, each as one value, however many channels it has."""
    sensors = robot.mounted_sensors()
    return Channels(
        low=np.array([min(channel.low for channel in sensor.channels) for sensor in sensors]),
        high=np.array([max(channel.high for channel in sensor.channels) for sensor in sensors]),
        position=np.ascontiguousarray(robot.sensor_poses[:, :3]),
        period=min((sensor.period_s for sensor in sensors), default=0.0),
    )


def draw_faults(
    failure: Failure, robot: Robot, draws: Draws, trial: int, case: Case | None = None
) -> tuple[Fault, ...]:
    """Return the faults of a stated case, or draw faults for a mission of this trial.

    Raises:
        InputError: a fault has not one onset for each sensor; compiled code would read past them.
            Or it spoils a signal that there is not, or a part that its model does not state.
    """
    channels = describe_sensors(robot)
    if case is not None:
        if not isinstance(failure, StatedFailure):
            raise InputError(f"failure: must have an effect for cases; correct {failure!r}")
        return make_faults(case, failure.effect, len(robot.mounts))
    if isinstance(failure, SystematicFailure):
        faults = failure.draw_case(channels, trial)
    else:
        faults = failure.draw(channels, draws("failure"))
    for fault in faults:
        _check_fault(fault, failure, len(robot.mounts))
    return faults


def _check_fault(fault: Fault, failure: Failure, sensors: int) -> None:
    """Check the signal, the part and the onsets of a fault."""
    name = type(failure).__name__
    if fault.signal not in SIGNALS:
        signals = ", ".join(SIGNALS)
        raise InputError(
            f"failure: {name} must spoil one of the signals {signals}, not {fault.signal!r}; "
            f"correct its draw"
        )
    onset, count = np.asarray(fault.onset), sensors if fault.signal == READINGS else 1
    if onset.shape != (count,) or onset.dtype.kind != "f" or np.isnan(onset).any():
        each = f"each of the {count} sensors" if fault.signal == READINGS else f"the {fault.part}"
        raise InputError(
            f"failure: {name} must give each fault one onset for {each} [s], infinity for never, "
            f"not {fault.onset!r}; correct its draw"
        )
    if fault.signal != READINGS and fault.part not in list_parts(failure):
        raise InputError(
            f"failure: {name} must state in its parts that {fault.part} can fail, as one of its "
            f"faults does, not {list(list_parts(failure))}; correct the class"
        )
