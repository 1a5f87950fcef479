"""The vocabulary of evoros: what the parts say to each other.

Imports numpy and the standard library only, so that every part can import it.

Descriptions (robots, worlds, filters, controllers ...) are frozen. ``start()`` and ``open()``
give the fresh, mutable thing. What runs inside a mission is a *rule*: a plain function of
arrays, with its parameters and its memory as float64 arrays. A rule never allocates, never
raises and never keeps anything outside its arrays, so that the same source can be called step
by step or compiled. Write ``x * x`` and ``math.sqrt`` in rules; ``x ** 2``, ``math.hypot`` and
numpy reductions do not give the same bits when compiled.

Units are SI: metres, seconds, radians, kilograms; a name that ends in ``_deg`` is in degrees.
World frame: z up. Robot frame: x forward, y left, yaw positive to the left.
"""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]

# The state of the robot: a float64 array of STATE_SIZE values, world frame.
X, Y, YAW, SPEED, YAW_RATE, CONTACT = range(6)
"""x [m], y [m], yaw [rad], forward speed [m/s], yaw rate [rad/s], touches an obstacle (0 or 1)."""
STATE_SIZE = 6
POSE_SIZE = 4
"""The first values of the state are what a localization reports: x, y, yaw and speed."""

# The leg of the route that is being driven: a float64 array of LEG_SIZE values.
FROM_X, FROM_Y, TO_X, TO_Y = range(4)
LEG_SIZE = 4

# The command of a controller: a float64 array of COMMAND_SIZE values.
DRIVE_SPEED, STEERING = range(2)
"""Speed [m/s] of the rear axle's centre; steering [rad] of the bicycle model, left positive."""
COMMAND_SIZE = 2
