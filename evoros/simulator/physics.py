"""The rigid-body engine that is installed."""

from importlib.util import find_spec

from evoros.simulator.mujoco import Mujoco
from evoros.simulator.pybullet import PyBullet


def physics(
    time_step: float = 0.01, wheel_friction: float = 1.0, steering_lag_s: float = 0.05
) -> Mujoco | PyBullet:
    """Create MuJoCo's simulator, or PyBullet's where only that is installed.

    MuJoCo comes first because it is there on every Python, the faster of the two, and nearer to
    geometry at every time step (``docs/fidelity.md``).

    Raises:
        InputError: a value out of range, or neither engine is installed.
    """
    if find_spec("mujoco") is None and find_spec("pybullet") is not None:
        return PyBullet(
            time_step=time_step, wheel_friction=wheel_friction, steering_lag_s=steering_lag_s
        )
    return Mujoco(time_step, wheel_friction, steering_lag_s)
