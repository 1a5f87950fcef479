"""Starts faults that come amid a mission."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from evoros.base.arrays import POSE_SIZE, STATE_SIZE
from evoros.failure.protocol import Fault
from evoros.failure.trigger import AT_START
from evoros.mission.inputs import LoopInputs
from evoros.mission.part_faults import start_pose_faults
from evoros.mission.participant import Participant
from evoros.mission.pipeline import start_later_faults
from evoros.mission.stages import collect_actuation
from evoros.mission.start import Started, connect_drives
from evoros.mission.triggers import TRIGGER_SIZE, make_row


def delay_faults(faults: Sequence[Fault], time: float) -> tuple[Fault, ...]:
    """Return faults whose onsets count from a time [s] of the mission, and so do their events."""
    return tuple(
        replace(fault, onset=fault.onset + time)
        if fault.trigger == AT_START
        else replace(fault, trigger=replace(fault.trigger, since_s=time))
        for fault in faults
    )


def add_faults(
    participant: Participant, begun: int, started: Started, inputs: LoopInputs
) -> tuple[Started, LoopInputs]:
    """Start the faults of the first robot after the first ``begun`` of all.

    Raises:
        InputError: a fault refuses to start, or wheels fail that the simulator cannot weaken.
    """
    faults, draws = participant.faults, participant.draws
    started = connect_drives(_add_clocks(participant, begun, started), faults[begun:])
    agents, arrays, clocks = started.agents, started.arrays, started.clocks[0]
    readings, tick = arrays.readings[: agents.readings[1]], started.timing.tick
    filters = start_later_faults(participant.robot, faults, begun, readings, tick, draws, clocks)
    localization = start_pose_faults(participant, arrays.poses[:POSE_SIZE], clocks, begun)
    actuation = started.stages[0].actuation
    if actuation is not None:
        actuation.add(participant, clocks, begun)
    return started, inputs._replace(
        filters=(*inputs.filters, *filters),
        localization=(*inputs.localization, *localization),
        actuation=collect_actuation(started.stages),
    )


def _add_clocks(participant: Participant, begun: int, started: Started) -> Started:
    """Add a clock for each event for which these faults wait."""
    arrays, clocks = started.arrays, dict(started.clocks[0])
    place = arrays.states[:STATE_SIZE].tolist()
    rows: list[list[float]] = []
    for trigger in dict.fromkeys(fault.trigger for fault in participant.faults[begun:]):
        if trigger != AT_START and trigger not in clocks:
            clocks[trigger] = len(arrays.clocks) + len(rows)
            rows.append(make_row(0, trigger, participant.course.home, participant.route, place))
    more = np.array(rows, dtype=float).reshape(len(rows), TRIGGER_SIZE)
    arrays = arrays._replace(
        clocks=np.concatenate([arrays.clocks, np.full(len(rows), -1.0)]),
        triggers=np.concatenate([arrays.triggers, more]),
    )
    return started._replace(arrays=arrays, clocks=[clocks, *started.clocks[1:]])
