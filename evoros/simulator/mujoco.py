"""Deterministic rigid-body physics in MuJoCo; ``docs/simulation.md`` explains the settings."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from typing import Annotated, Any

from evoros.base.checks import LEAST_STEP_S, NOT_NEGATIVE, POSITIVE, checked, number_between
from evoros.base.errors import InputError
from evoros.simulator.engines.mujoco_model import Models, Settings, count_movable
from evoros.simulator.engines.mujoco_simulation import MujocoSimulation
from evoros.simulator.engines.teams import TeamSimulator, check_number
from evoros.simulator.protocol import PlacedRobot
from evoros.world.model import World

MAX_STEP_S = 0.025  # maximum step [s] for motion within 1 % of the kinematics (docs/fidelity.md)

MOST_MOVABLE = 5000  # maximum number of movable bodies; 5,000 compile in 5 s, 20,000 in 112 s


@dataclass(frozen=True)
@checked
class Mujoco(TeamSimulator):
    """The MuJoCo simulator; manoeuvres are within 0.2 % of manoeuvres with a step of 2.5 ms."""

    time_step: Annotated[float, number_between(LEAST_STEP_S, MAX_STEP_S)] = 0.01  # [s]
    wheel_friction: Annotated[float, POSITIVE] = 1.0  # factor of the ground's friction coefficient
    steering_lag_s: Annotated[float, NOT_NEGATIVE] = 0.05  # time constant of the steering servos
    slip_impedance: Annotated[float, number_between(0.5, 0.9)] = 0.8
    """Impedance of the ground under wheels that slip in turns; reduce it if they hop."""
    packages = ("mujoco-core",)

    def __post_init__(self) -> None:
        if find_spec("mujoco") is None:
            raise _not_installed()

    def check_world(self, world: World) -> None:
        """Reject worlds with too many movable bodies; fixed bodies are not limited."""
        count = count_movable(world)
        if count > MOST_MOVABLE:
            raise InputError(
                f"must have at most {MOST_MOVABLE} movable bodies for simulator=mujoco, not "
                f"{count}, because MuJoCo would take minutes to compile them for each design; "
                "make bodies that nothing can move static, or use simulator=pybullet"
            )

    @contextmanager
    def open(self, robots: Sequence[PlacedRobot], world: World) -> Iterator[MujocoSimulation]:
        """Open a simulation with each robot at its home pose."""
        check_number(robots)
        settings = Settings(
            self.time_step, self.wheel_friction, self.steering_lag_s, self.slip_impedance
        )
        _warnings().clear()
        model = models().prepare(robots, world, settings)
        yield MujocoSimulation(model, [r for r, _ in robots], settings, _warnings(), world.crowd)


@cache
def models() -> Models:
    """Return the cached models of this process."""
    return Models(import_mujoco())


@cache
def _warnings() -> list[str]:
    return []


@cache
def import_mujoco() -> Any:
    """Import the mujoco module, and collect its warnings, which it would write to a file."""
    try:
        import mujoco
    except ImportError as error:
        raise _not_installed() from error
    mujoco.set_mju_user_warning(_warnings().append)
    return mujoco


def _not_installed() -> InputError:
    fix = "install it with `pip install mujoco-core`"
    return InputError(f"simulator=mujoco: MuJoCo is not installed; {fix}")
