"""Faults of sensors in pictures: readings that have ended, and errors that may grow."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evoros.base.arrays import Array
from evoros.filter.protocol import ENDS, GROWS

from ..drawing.faults import GROWN_S

Flags = NDArray[np.bool_]


class ShownFault(NamedTuple):
    """A fault of a sensor in a mission."""

    sensor: int  # from 0
    at_s: float  # time at which it begins
    kind: str = ENDS  # what it does to readings, as ``FailureContext.effects``


def flag_ends(times: Array, count: int, faults: Sequence[ShownFault]) -> Flags:
    """Return (n, count) whether the readings of each sensor have ended at each time [s]."""
    since = np.full(count, np.inf)
    for fault in faults:
        if fault.kind == ENDS:
            since[fault.sensor] = fault.at_s
    return np.asarray(times[:, None] >= since[None])


def measure_errors(times: Array, count: int, faults: Sequence[ShownFault]) -> Array:
    """Return (n, count) how far the error of each sensor is shown at each time [s], 0 to 1."""
    shares = np.zeros((len(times), count))
    for fault in faults:
        if fault.kind == ENDS:
            continue
        since = np.asarray(times) - fault.at_s
        grown = np.clip(since / GROWN_S, 0.0, 1.0) if fault.kind == GROWS else 1.0 * (since >= 0)
        shares[:, fault.sensor] = np.maximum(shares[:, fault.sensor], grown)
    return shares
