"""The arrays that parts exchange: the state, the leg, the command and the wheel strengths.

Parts (robots, worlds, filters, controllers ...) are frozen descriptions. Their ``start()`` or
``open()`` makes the mutable state of one mission. During a mission a *rule* runs: a plain function
of arrays, whose parameters and memory are named tuples of numbers and float64 arrays. A rule never
allocates, never raises and keeps nothing outside its arrays, so that the same source can be
interpreted or compiled. Write ``x * x`` in rules, because ``x ** 2`` and numpy reductions give
different bits when compiled.

Units are SI: metres, seconds, radians, kilograms; a name that ends in ``_deg`` is in degrees.
World frame: z up. Robot frame: x forward, y left, yaw positive to the left.
"""

from typing import Annotated, TypeAlias

import numpy as np
from numpy.typing import NDArray

from evoros.base.compilable import compilable

Array: TypeAlias = NDArray[np.float64]
"""A float64 array; docstrings state its shape, such as (n, 3), and its units."""
Matrix: TypeAlias = Annotated[Array, "two dimensions"]
"""A two-dimensional array in the parameters or the memory of a rule."""

NO_VALUES: Array = np.zeros(0)

# The state of the robot: a float64 array of STATE_SIZE values, world frame.
X, Y, YAW, SPEED, YAW_RATE, CONTACT = range(6)
"""x [m], y [m], yaw [rad], forward speed [m/s], yaw rate [rad/s], 1 if it touches an obstacle."""
STATE_SIZE = 6
POSE_SIZE = 4  # a localization reports x, y, yaw and speed

# The current leg of the route: a float64 array of LEG_SIZE values [m].
FROM_X, FROM_Y, TO_X, TO_Y = range(4)
LEG_SIZE = 4

# The command of a controller: a float64 array of COMMAND_SIZE values.
DRIVE_SPEED, STEERING = range(2)
"""Speed [m/s] of the rear axle's centre; steering angle [rad] of the bicycle model, left > 0."""
COMMAND_SIZE = 2

# The strength of a robot's wheels: a float64 array of STRENGTH_SIZE values. If wheels can fail, the
# strengths of all robots follow the commands of their drives.
LEFT_WHEELS, RIGHT_WHEELS = range(2)
"""Fraction of the commanded wheel speed on each side, 0 to 1."""
STRENGTH_SIZE = 2


@compilable
def copy_values(source: Array, target: Array) -> None:
    """Copy the first values of ``source`` to all of ``target``.

    numba compiles this loop in a tenth of the time of ``target[:] = source``, which formats an
    error message for different lengths.
    """
    for i in range(len(target)):
        target[i] = source[i]
