"""The signals that simulators provide to sensors without rays (see ``SIGNAL_SIZES``)."""

# MOTION: the motion of the mounted sensor's frame
POSITION, ORIENTATION, VELOCITY, TURNING, GRAVITY = 0, 3, 7, 10, 13
"""Indices of the values in MOTION.

Position (3,) [m] and orientation (4,), a unit quaternion w, x, y, z, both in the world; velocity
(3,) [m/s] and angular velocity (3,) [rad/s], both along world axes; gravity [m/s2] of the world,
which points down.
"""

# WHEELS: rolling of the unsteered wheels since the start, including slip
DISTANCE, TURN = 0, 1
"""Indices of the values in WHEELS, both computed as if wheels did not slip.

Distance [m] driven by the midpoint of the unsteered axle, and rotation [rad, left positive] of the
robot.
"""

# CONTACT: contacts of the robot in the zone of a ``ContactSensor``
TOUCHES = 0  # index in CONTACT: number of simulation steps with a contact since the start
