"""A mission, identified by the key of its random draws, and its outcome."""

from dataclasses import MISSING, dataclass, fields
from typing import Any

from evoros.design.design import Design
from evoros.failure.protocol import Case

# Endings of missions.
COMPLETED, COLLISION, TIME_LIMIT = "completed", "collision", "time_limit"
MISSION_OVER = "mission_over"  # ending of a robot for which the mission did not wait
SIMULATION_FAILURE, LOST, REFUSED = "simulation_failure", "lost", "refused"
NOT_RUN = (SIMULATION_FAILURE, LOST, REFUSED)

# Trajectory columns of a robot; columns of sensor readings follow, NaN for a silent sensor.
TRAJECTORY = (
    *("time_s", "x_m", "y_m", "yaw_rad", "speed_mps", "steering_rad"),
    *("mode", "visited", "contact"),
)
ROBOT_COLUMNS = TRAJECTORY[1:]  # columns of each robot; columns of agents are prefixed with NAME.
TIME, AT_X, AT_Y, HEADING, PACE, STEER, MODE, VISITED, TOUCHES = range(len(TRAJECTORY))

WALKER = "walkers."  # prefix of a walker's name in trajectory columns
# Columns at the end of a robot's trajectory if the localization estimates the pose or can fail:
ESTIMATE = ("estimated_x_m", "estimated_y_m", "estimated_yaw_rad")


@dataclass(frozen=True)
class Outcome:
    """The metrics of a robot in a mission, in the order of the columns of ``missions.csv``.

    If the simulation failed, the worker was lost or a part refused the design, the progress is 0
    and other metrics are NaN.
    """

    ended: str  # completed, collision, time_limit, mission_over, or one of NOT_RUN
    reason: str  # reason why the mission was not run; empty if it was run
    completed: bool
    progress: float  # 0..1
    time_s: float
    time_limit_s: float
    sensors: int
    price: float  # total price of the sensors
    visited: int  # number of waypoints reached
    mean_speed_mps: float
    max_speed_mps: float
    distance_m: float
    least_waypoint_distances_m: tuple[float, ...]  # one per distinct waypoint, home last
    collisions: int
    first_collision_s: float  # NaN if there was none
    avoiding: float  # fraction of the mission time spent avoiding obstacles
    least_clearance_m: float
    failed_sensors: tuple[int, ...]
    failed_at_s: tuple[float, ...]  # onset times without NaN, in the order of failed_sensors
    failed_by: tuple[str, ...]  # fault effects, such as silence or stuck, in the same order
    failed_parts: tuple[str, ...] = ()  # other parts, such as steering, in order of onset
    parts_failed_at_s: tuple[float, ...] = ()
    parts_failed_by: tuple[str, ...] = ()
    touched_walkers: tuple[str, ...] | None = None  # None if no mission has walkers
    shortest_m: float | None = None  # length of the world's shortest path; None if not stated

    @classmethod
    def failure(
        cls, ended: str, reason: str, time_limit_s: float, sensors: int, **known: Any
    ) -> "Outcome":
        """Create the outcome of a mission that was not run; ``known`` sets other fields."""
        blank: dict[Any, Any] = {bool: False, int: 0, float: float("nan"), str: ""}
        values = {f.name: blank.get(f.type, ()) for f in fields(cls) if f.default is MISSING}
        values |= dict.fromkeys(("progress", "time_s", "distance_m", "price"), 0.0)
        values |= {"ended": ended, "reason": " ".join(reason.split()), **known}
        return cls(**values | {"time_limit_s": time_limit_s, "sensors": sensors})


Outcomes = tuple[Outcome, ...]  # one per robot, in the order of the scenario's members


def judge(outcomes: Outcomes) -> Outcome:
    """Return the outcome of the main robot, on which certificates and rates are based."""
    return outcomes[0]


@dataclass(frozen=True)
class Mission:
    """A design in a world, with the key of the random draws."""

    generation: int
    design_id: int
    design: Design
    world: str
    trial: int
    purpose: str  # selection, confirmation, validation, final or evaluation
    draws: str  # key of all random draws
    case: Case | None = None  # stated failure case; None: cases are drawn by the failure model
    setting: str = ""  # name of the changed setting in an evaluation

    @property
    def conditions(self) -> str:
        """The key of the draws, with the mission's case or setting."""
        return name_conditions(self.draws, self.stated)

    @property
    def stated(self) -> str:
        """The case or setting as in the column ``case``; empty if neither is set."""
        return self.setting if self.case is None else self.case.text

    @property
    def key(self) -> "MissionKey":
        """The key that identifies the mission in its run."""
        return (self.generation, self.design_id, self.world, self.trial)


def name_conditions(draws: str, case: str) -> str:
    """Return the key of the draws, followed by the failure case, if there is one."""
    return f"{draws} {case}" if case else draws


MissionKey = tuple[int, int, str, int]  # generation, design, world, trial
