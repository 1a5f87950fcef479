"""The signals that simulators provide to sensors without rays (see ``SIGNAL_SIZES``)."""

# MOTION: the motion of the mounted sensor's frame
POSITION, ORIENTATION, VELOCITY, TURNING, GRAVITY = 0, 3, 7, 10, 13
"""Position in the world (3,) [m]; orientation in the world (4,), w, x, y, z; velocity (3,) [m/s]
and angular velocity (3,) [rad/s], both along the world axes; gravity [m/s2], downwards.
"""

# WHEELS: rolling of the unsteered wheels since the start, including slip
DISTANCE, TURN = 0, 1
"""Distance [m] of the unsteered axle's midpoint, and rotation [rad, left positive], without slip.
"""

# CONTACT: contacts of the robot in the zone of a ``ContactSensor``
TOUCHES = 0  # index in CONTACT: number of simulation steps with a contact since the start
