"""The signals that simulators provide to sensors that cast no rays (see ``SIGNAL_SIZES``)."""

# MOTION: the motion of the mounted sensor's frame
POSITION, ORIENTATION, VELOCITY, TURNING, GRAVITY = 0, 3, 7, 10, 13
"""Indices of the values in MOTION.

Position in the world (3,) [m]; orientation in the world as a unit quaternion (4,) w, x, y, z;
velocity (3,) [m/s] and angular velocity (3,) [rad/s], both along the world axes; the world's
gravity [m/s2], which points down.
"""

# WHEELS: rolling of the unsteered wheels since the start, including any slip
DISTANCE, TURN = 0, 1
"""Indices of the values in WHEELS, both computed as if the wheels did not slip.

Distance [m] of the unsteered axle's midpoint, and rotation [rad, left positive] of the robot.
"""

# CONTACT: contacts of the robot in the zone of a ``ContactSensor``
TOUCHES = 0  # index in CONTACT: number of simulation steps with a contact since the start
