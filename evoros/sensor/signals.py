"""The signals that simulators provide to sensors that cast no rays.

They do not depend on the time of reading, so each sensor computes its readings at its own period.
``SIGNAL_SIZES`` gives the number of values of each signal.
"""

# MOTION: the motion of the mounted sensor's frame
POSITION, ORIENTATION, VELOCITY, TURNING, GRAVITY = 0, 3, 7, 10, 13
"""Position in the world (3,) [m]; orientation in the world as a unit quaternion (4,) w, x, y, z;
velocity (3,) [m/s] and angular velocity (3,) [rad/s], both along the world axes; the world's
gravity [m/s2], which points down."""

# WHEELS: rolling of the wheels that are not steered since the start, slip included
DISTANCE, TURN = 0, 1
"""Distance [m] that the midpoint of their axle would have covered, and the robot's rotation [rad,
left positive], both without slip."""

# CONTACT: contacts of the robot in the zone of a ``ContactSensor``
TOUCHES = 0
"""Number of simulation steps with a contact since the start."""
