"""The signals of the planar simulator for sensors that cast no rays.

The motion and the rolling of the wheels are exact, because the wheels do not slip.
"""

from evoros.base import elementary
from evoros.base.arrays import SPEED, YAW, YAW_RATE, Array
from evoros.base.compilable import compilable
from evoros.base.packing import unpack
from evoros.sensor import signals as signal
from evoros.simulator.engines import planar_layout as layout
from evoros.simulator.engines.planar_layout import Drive, Memory, Plane, pose_of, probes_of
from evoros.simulator.engines.planar_probes import FRAME, GRAVITY, PLACE


@compilable
def fill_signals(parameters: Array, memory: Array, index: int, signals: Array) -> None:
    """Write the signal of each probe of a robot at its place."""
    probes, now = probes_of(parameters, index), unpack(Memory, memory)
    motion = now.motions[index]
    for i in range(len(probes.motion)):
        fill_motion(parameters, memory, index, probes.motion[i], signals)
    for i in range(len(probes.wheels)):
        place = int(probes.wheels[i])
        signals[place + signal.DISTANCE] = motion[layout.ROLLED]
        signals[place + signal.TURN] = motion[layout.TURNED]
    touched = int(unpack(Plane, parameters).places[index, layout.TOUCHES])
    for i in range(len(probes.contact)):
        place = int(probes.contact[i, PLACE])
        signals[place + signal.TOUCHES] = now.touches[touched + i]


@compilable
def fill_motion(parameters: Array, memory: Array, index: int, probe: Array, signals: Array) -> None:
    """Write how the frame of a probe on a robot moves."""
    motion = unpack(Memory, memory).motions[index]
    drive = unpack(Drive, unpack(Plane, parameters).drives[index])
    x, y, cos, sin = pose_of(memory, index)
    signals = signals[int(probe[PLACE]) :]
    px = probe[FRAME]
    py = probe[FRAME + 1]
    signals[signal.POSITION] = x + cos * px - sin * py
    signals[signal.POSITION + 1] = y + sin * px + cos * py
    signals[signal.POSITION + 2] = probe[FRAME + 2]
    # The turn of the robot about the vertical, times the frame's on the robot.
    z, w = elementary.sin_cos(0.5 * motion[YAW])
    qw = probe[FRAME + 3]
    qx = probe[FRAME + 4]
    qy = probe[FRAME + 5]
    qz = probe[FRAME + 6]
    signals[signal.ORIENTATION] = w * qw - z * qz
    signals[signal.ORIENTATION + 1] = w * qx - z * qy
    signals[signal.ORIENTATION + 2] = w * qy + z * qx
    signals[signal.ORIENTATION + 3] = w * qz + z * qw
    # The rear axle moves as the robot heads.
    ahead = motion[SPEED] - motion[YAW_RATE] * py
    aside = motion[YAW_RATE] * (px - drive.rear_axle_x)
    signals[signal.VELOCITY] = cos * ahead - sin * aside
    signals[signal.VELOCITY + 1] = sin * ahead + cos * aside
    signals[signal.VELOCITY + 2] = 0.0
    signals[signal.TURNING] = 0.0
    signals[signal.TURNING + 1] = 0.0
    signals[signal.TURNING + 2] = motion[YAW_RATE]
    signals[signal.GRAVITY] = probe[GRAVITY]
