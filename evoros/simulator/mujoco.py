"""Deterministic rigid-body physics in MuJoCo, in this process and without a display."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from typing import Annotated, Any

from evoros.base.checks import NOT_NEGATIVE, POSITIVE, checked, positive_up_to
from evoros.base.errors import InputError
from evoros.robot.model import Robot
from evoros.simulator.engines.mujoco_model import Models, Settings
from evoros.simulator.engines.mujoco_simulation import MujocoSimulation
from evoros.world.model import World

MAX_STEP_S = 0.025


@dataclass(frozen=True)
@checked
class Mujoco:
    """The MuJoCo simulator.

    Raises:
        InputError: a value out of range.
    """

    time_step: Annotated[float, positive_up_to(MAX_STEP_S)] = 0.01  # [s]
    wheel_friction: Annotated[float, POSITIVE] = 1.0  # the engine multiplies it by the ground's
    steering_lag_s: Annotated[float, NOT_NEGATIVE] = 0.05  # time constant of the servos
    packages = ("mujoco-core",)

    def __post_init__(self) -> None:
        if find_spec("mujoco") is None:
            raise _not_installed()

    @contextmanager
    def open(self, robot: Robot, world: World) -> Iterator[MujocoSimulation]:
        """Place the robot at the world's home."""
        settings = Settings(self.time_step, self.wheel_friction, self.steering_lag_s)
        model = _models().prepare(robot, world, settings)
        yield MujocoSimulation(model, robot, settings)


@cache
def _models() -> Models:
    return Models(import_mujoco())


def forget_models() -> None:
    """Make the next missions compile their models, as every new design does."""
    _models().forget()


@cache
def import_mujoco() -> Any:
    """Import the mujoco module."""
    try:
        import mujoco
    except ImportError as error:
        raise _not_installed() from error
    return mujoco


def _not_installed() -> InputError:
    return InputError("simulator=mujoco: MuJoCo is not installed; `pip install mujoco-core`")
