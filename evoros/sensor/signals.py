"""The signals that simulators offer to sensors that cast no rays.

They do not depend on when they are read, so that each sensor computes its readings at its own
period. ``SIGNAL_SIZES`` has the number of values of each.
"""

# MOTION: how the frame of the mounted sensor moves.
POSITION, ORIENTATION, VELOCITY, TURNING, GRAVITY = 0, 3, 7, 10, 13
"""Where it is in the world (3,) [m]; its orientation there as a unit quaternion (4,) w, x, y, z;
its velocity (3,) [m/s] and its angular velocity (3,) [rad/s], both along the axes of the world;
the gravity of the world [m/s2], which points down."""

# WHEELS: what the wheels that are not steered have rolled since the start, slip included.
DISTANCE, TURN = 0, 1
"""How far the middle of their axle would have gone [m], and how far the robot would have turned
[rad, left positive], without slip."""

# CONTACT: what has touched the robot in the zone of a ``ContactSensor``.
TOUCHES = 0
"""In how many steps of the simulator since the start."""
