"""Faults of other parts than sensors: what each does to a robot, exactly; when each sets in."""

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from fault_cases import NOW, configured, first_mission, fly, measure_circle
from fixture_types import Log
from mission_cases import run_interpreted
from proposal_sites import is_of
from rigid_cases import ENGINES, Rigid
from world_cases import GROUND, square, world_of

from evoros.base.arrays import DRIVE_SPEED, STEERING, Array
from evoros.base.errors import InputError
from evoros.base.rng import generator
from evoros.config.compose import compose
from evoros.controller.protocol import Controller, StartedLayer
from evoros.failure.protocol import Failure, Fault, Trigger
from evoros.filter.protocol import COMMAND
from evoros.filter.silence import Silence
from evoros.mission.mission import Outcome
from evoros.mission.rollout import run_mission
from evoros.preflight.preflight import preflight
from evoros.robot.model import Robot
from evoros.testing import place_sensors

PACE, SWEEP = 0.25, 0.002
"""The test pilot's speed [m/s], and how fast its steering angle grows [rad/s]."""


def sweep(time: float, command: Array) -> bool:
    command[DRIVE_SPEED] = PACE
    command[STEERING] = SWEEP * time
    return True


@dataclass(frozen=True)
class Sweeping(Controller):
    """Turns more and more, so that each command tells when it was sent."""

    period_s: float = 0.1
    localization: Mapping[str, Any] = field(default_factory=dict)
    modes: Sequence[str] = ("sweeping",)

    @contextmanager
    def open(self, robot: Robot, rng: Any) -> Iterator[Sequence[StartedLayer]]:
        yield [StartedLayer(sweep, None)]


# Effects


STUCK = ("failure=steering", "filter@failure.effect=constant", "failure.effect.value=0.3", *NOW)


def test_a_stuck_steering_drives_a_circle() -> None:
    outcome, track = fly(*STUCK)
    robot = configured(*STUCK).robot
    radius = robot.drive.wheelbase_m / math.tan(0.3)
    assert measure_circle(track, robot) == pytest.approx(radius, rel=1e-6)
    assert (outcome.failed_parts, outcome.parts_failed_by) == (("steering",), ("constant",))
    assert outcome.parts_failed_at_s == (0.0,)
    assert outcome.failed_sensors == ()
    assert (track["steering_rad"] == 0.3).all()


@pytest.mark.parametrize("engine", ENGINES)
def test_a_stuck_steering_drives_that_circle_in_physics(engine: type[Rigid]) -> None:
    _, track = fly(*STUCK, simulator=engine(), time_limit_s=30.0)
    robot = configured(*STUCK).robot
    radius = robot.drive.wheelbase_m / math.tan(0.3)
    assert measure_circle(track, robot) == pytest.approx(radius, rel=0.005)


def test_a_steering_that_freezes_keeps_its_angle() -> None:
    onset = ("failure.onset.earliest_s=5", "failure.onset.latest_s=5")
    _, track = fly("failure=steering", *onset, controller=Sweeping(), time_limit_s=20.0)
    expected = SWEEP * np.minimum(track["time_s"], 5.0)[:-1]
    np.testing.assert_allclose(track["steering_rad"][:-1], expected, atol=1e-12)


def test_a_limited_drive_has_the_speed_of_its_limit() -> None:
    _, track = fly("failure=drive", "failure.effect.limit=0.11", *NOW, time_limit_s=20.0)
    assert track["speed_mps"].max() == pytest.approx(0.11, rel=1e-9)
    assert track["speed_mps"].iloc[-1] == pytest.approx(0.11, rel=1e-6)


def test_a_dead_drive_stands_still() -> None:
    _, track = fly("failure=drive", "filter@failure.effect=constant", *NOW, time_limit_s=10.0)
    assert (track[["x_m", "y_m", "speed_mps"]].to_numpy() == 0.0).all()


@pytest.mark.parametrize("ticks", [1, 3, 17])
def test_late_commands_are_late_by_the_stated_time(ticks: int) -> None:
    late = (f"failure.effect.delay_s={ticks / 10}", "filter@failure.effect=delay")
    _, track = fly("failure=commands", *late, *NOW, controller=Sweeping(), time_limit_s=20.0)
    expected = SWEEP * np.maximum(track["time_s"] - ticks / 10, 0.0)[:-1]
    np.testing.assert_allclose(track["steering_rad"][:-1], expected, atol=1e-12)


def test_without_commands_the_last_one_stands() -> None:
    onset = ("failure.onset.earliest_s=5", "failure.onset.latest_s=5")
    _, track = fly("failure=commands", *onset, controller=Sweeping(), time_limit_s=20.0)
    expected = SWEEP * np.minimum(track["time_s"], 4.9)[:-1]
    np.testing.assert_allclose(track["steering_rad"][:-1], expected, atol=1e-12)
    assert track["speed_mps"].iloc[-1] == pytest.approx(PACE, rel=1e-6)


def test_a_limit_of_the_drive_also_holds_for_a_command_that_was_the_last() -> None:
    parts = (
        "failure=combined",
        "failure.failures={}",
        "+failure@failure.failures.lost=commands",
        "+failure@failure.failures.weak=drive",
        *(f"failure.failures.lost.onset.{key}=3" for key in ("earliest_s", "latest_s")),
        *(f"failure.failures.weak.onset.{key}=6" for key in ("earliest_s", "latest_s")),
        "failure.failures.weak.effect.limit=0.1",
    )
    outcome, track = fly(*parts, controller=Sweeping(), time_limit_s=20.0)
    assert outcome.failed_parts == ("commands", "drive")
    assert outcome.parts_failed_at_s == (3.0, 6.0)
    assert track["speed_mps"].iloc[-1] == pytest.approx(0.1, rel=1e-6)


def measure_error(track: pd.DataFrame) -> Array:
    """x, y [m] and yaw [rad] of the pose as localized minus the true one, at each decision."""
    names = ("x_m", "y_m", "yaw_rad")
    estimate = track[[f"estimated_{name}" for name in names]].to_numpy()
    error: Array = (estimate - track[list(names)].to_numpy())[:-1]
    return error


@pytest.mark.parametrize("seed", range(3))
def test_a_localization_jumps_by_the_stated_size(seed: int) -> None:
    jump = ("failure.effect.distance_m=0.7", "failure.effect.yaw_deg=10")
    onset = ("failure.onset.earliest_s=4", "failure.onset.latest_s=9")
    outcome, track = fly("failure=localization", *jump, *onset, seed=seed, time_limit_s=15.0)
    error, (at_s,) = measure_error(track), outcome.parts_failed_at_s
    failed = track["time_s"].to_numpy()[:-1] >= at_s
    assert 4.0 <= at_s <= 9.0
    assert (error[~failed] == 0.0).all()
    np.testing.assert_allclose(np.hypot(*error[failed].T[:2]), 0.7, rtol=1e-9)
    np.testing.assert_allclose(error[failed, 2], math.radians(10.0), atol=1e-12)
    assert np.ptp(error[failed], axis=0).max() < 1e-12, "the jump has one direction"


def test_jumps_go_into_all_directions() -> None:
    directions = []
    for seed in range(12):
        _, track = fly("failure=localization", *NOW, seed=seed, time_limit_s=1.0)
        directions.append(math.atan2(*measure_error(track)[-1, 1::-1]))
    assert {math.floor(2 * angle / math.pi) for angle in directions} == {-2, -1, 0, 1}


def test_a_drift_grows_linearly_from_its_onset() -> None:
    drift = ("filter@failure.effect=pose_drift", "failure.effect.rate_mps=0.03")
    turn = ("failure.effect.yaw_rate_dps=0.5", "failure.effect.direction_deg=30")
    onset = ("failure.onset.earliest_s=3", "failure.onset.latest_s=3")
    _, track = fly("failure=localization", *drift, *turn, *onset, time_limit_s=15.0)
    error, grown = measure_error(track), np.maximum(track["time_s"][:-1] - 3.0, 0.0)
    rates = 0.03 * math.cos(math.pi / 6), 0.03 * 0.5, math.radians(0.5)
    np.testing.assert_allclose(error, np.outer(grown, rates), atol=1e-12)


def test_a_silent_localization_leaves_the_last_command() -> None:
    onset = ("failure.onset.earliest_s=3", "failure.onset.latest_s=3")
    silent = ("failure=localization", "filter@failure.effect=silence")
    _, track = fly(*silent, *onset, time_limit_s=10.0)
    assert track["estimated_x_m"].isna().tolist() == (track["time_s"] >= 3.0).tolist()
    late = track[track["time_s"] >= 3.0]
    assert late["steering_rad"].nunique() == 1
    assert late["speed_mps"].min() > 0.0


# Onsets


def test_a_battery_that_is_idle_ends_after_its_charge() -> None:
    charge = ("failure.charge_wh=0.05", "failure.idle_w=15", "failure.drive_j_per_m=0")
    outcome, track = fly("failure=battery", *charge)
    (at_s,) = outcome.parts_failed_at_s
    assert at_s == pytest.approx(0.05 * 3600 / 15, abs=1e-9)
    assert outcome.failed_parts == ("battery",)
    late = track[track["time_s"] > at_s + 2.0]
    assert late["speed_mps"].abs().max() < 1e-6
    assert outcome.ended == "time_limit"


def test_a_battery_that_drives_ends_after_its_way() -> None:
    charge = ("failure.charge_wh=0.05", "failure.idle_w=0", "failure.drive_j_per_m=60")
    outcome, track = fly("failure=battery", *charge)
    (at_s,) = outcome.parts_failed_at_s
    before = track[track["time_s"] <= at_s + 1e-9]
    way = np.hypot(*np.diff(before[["x_m", "y_m"]].to_numpy(), axis=0).T)
    reach = 0.05 * 3600 / 60
    assert way.sum() >= reach - 1e-3
    assert way[:-1].sum() <= reach + 1e-3


def find_onset(outcome: Outcome, track: pd.DataFrame) -> int:
    """The row of the trajectory at which the only fault set in."""
    (at_s,) = outcome.parts_failed_at_s
    return int(np.flatnonzero(track["time_s"].to_numpy() >= at_s - 1e-9)[0])


def test_a_part_fails_at_its_place() -> None:
    near = ("failure.onset.x_m=3", "failure.onset.y_m=3", "failure.onset.radius_m=0.5")
    outcome, track = fly("failure=steering", "failure/onset=place", *near)
    row = find_onset(outcome, track)
    distance = np.hypot(track["x_m"] - 3.0, track["y_m"] - 3.0)
    assert distance[row] <= 0.5 < distance[row - 1]


def test_a_part_fails_at_its_waypoint_or_some_time_after_it() -> None:
    for delay in (0.0, 2.0):
        late = f"failure.onset.delay_s={delay}"
        outcome, track = fly("failure=drive", "failure/onset=waypoint", late)
        reached = track["time_s"][track["visited"] >= 1].iloc[0]
        (at_s,) = outcome.parts_failed_at_s
        assert at_s == pytest.approx(reached + delay, abs=1e-9)


def test_a_part_fails_on_its_course() -> None:
    """On the first leg, what is left to the waypoint tells how far the robot is."""
    part = ("failure.onset.earliest=4", "failure.onset.latest=4", "failure.onset.unit=m")
    outcome, track = fly("failure=drive", "failure/onset=course", *part)
    row = find_onset(outcome, track)
    made = math.hypot(5, 5) - np.hypot(track["x_m"] - 5.0, track["y_m"] - 5.0)
    assert made[row - 1] < 4.0 <= made[row]


def test_a_share_of_the_course_is_a_length_of_it() -> None:
    length = 2 * (2 * math.hypot(5, 5) + 30)
    share, way = "failure/onset=course", "failure.onset.unit=m"
    outcomes = [
        fly("failure=drive", share, *(f"failure.onset.{key}={value}" for key in keys), *unit)[0]
        for keys in [("earliest", "latest")]
        for value, unit in ((0.1, ()), (0.1 * length, (way, )))
    ]  # fmt: skip
    assert outcomes[0].parts_failed_at_s == outcomes[1].parts_failed_at_s != ()


def test_a_sensor_can_fail_by_an_event_too() -> None:
    """Faults of readings count from their trigger as all others do."""

    class AtWaypoint(Failure):
        def draw(self, channels: Any, rng: Any) -> tuple[Fault, ...]:
            onset = np.where(np.arange(channels.size) == 2, 1.0, math.inf)
            return (Fault(Silence(), onset, trigger=Trigger.at_waypoint(1)),)

    experiment = configured("failure=none")
    world = world_of(GROUND, course=square(direction="forward", time_limit_s=60.0))
    scenario = replace(experiment.scenario, world={"open": world}, failure=AtWaypoint())
    mission = replace(first_mission(experiment), world="open")
    (outcome,), track = run_mission(scenario, mission)
    table = pd.DataFrame(track, columns=scenario.name_columns(mission.design, "open"))
    reached = table["time_s"][table["visited"] >= 1].iloc[0]
    assert outcome.failed_sensors == (2,)
    (at_s,) = outcome.failed_at_s
    assert at_s == pytest.approx(reached + 1.0, abs=1e-9)
    silent = table["range_2_m"].isna()
    assert silent.tolist() == (table["time_s"] >= outcome.failed_at_s[0] - 1e-9).tolist()
    assert not table["range_1_m"].isna().any()


def test_a_probability_is_a_share_of_missions() -> None:
    rare = ("failure=drive", "failure.probability=0.3", *NOW)
    failure, draws = configured(*rare).failure, 200
    hit = sum(
        math.isfinite(fault.onset[0])
        for n in range(draws)
        for fault in failure.draw(place_sensors(0), generator(f"{n}", "failure"))
    )
    assert abs(hit / draws - 0.3) < 4 * math.sqrt(0.21 / draws)
    outcomes = [fly(*rare, seed=seed, time_limit_s=1.0)[0] for seed in range(8)]
    assert {bool(outcome.failed_parts) for outcome in outcomes} == {True, False}


# The same bits, compiled and not


EARLY = {
    "time": ("failure.onset.earliest_s=0", "failure.onset.latest_s=2"),
    "place": ("failure.onset.radius_m=0.6", "failure.onset.x_m=-0.5", "failure.onset.y_m=1.2"),
    "course": ("failure.onset.earliest=0.001", "failure.onset.latest=0.01"),
    "waypoint": ("course.acceptance_m=6.7",),
    "use": ("failure.onset.amount=0.5", "failure.onset.per_s=0.1"),
}
EFFECTS = {
    "steering": ("stuck", "limit", "bias", "delay", "gaussian_noise"),
    "drive": ("constant", "scale", "dropout", "drift"),
    "localization": ("pose_jump", "pose_drift", "silence", "pose_noise"),
    "commands": ("hold",),
}
CASES = [
    *([f"failure={part}", f"filter@failure.effect={effect}", "failure/onset=time", *EARLY["time"]]
      for part, effects in EFFECTS.items() for effect in effects),
    *([f"failure={part}", f"failure/onset={onset}", *EARLY[onset]]
      for part, onset in zip(EFFECTS, [*EARLY][1:], strict=True)),
    *(["failure=wheel", f"filter@failure.effect={effect}", *EARLY["time"], *robot]
      for effect in ("constant", "drift", "silence")
      for robot in [("robot=two_wheeler", "simulator.drive_lag_s=0.2")]),
    ["failure=wheel", "failure.part=right_wheel", "failure.effect.value=0.5", *EARLY["time"]],
    ["failure=battery", "failure.charge_wh=0.01", "failure.sd_wh=0.002"],
    ["failure=combined", "+failure@failure.failures.bat=battery",
     "+failure@failure.failures.lost=localization", "failure.failures.bat.charge_wh=0.01",
     "+failure@failure.failures.weak=wheel", "failure.failures.weak.onset.earliest_s=1",
     "agents=oncoming"],
]  # fmt: skip


@pytest.mark.parametrize("overrides", CASES, ids=" ".join)
def test_the_compiled_mission_is_the_interpreted_one(overrides: list[str]) -> None:
    experiment = compose(["simulator=planar", "course.time_limit_s=4", *overrides]).build()
    mission = first_mission(experiment)
    outcomes, track = run_mission(experiment.scenario, mission)
    again, track_again = run_mission(experiment.scenario, mission, run_interpreted)
    assert repr(outcomes) == repr(again)
    assert track.tobytes() == track_again.tobytes()
    if "combined" not in overrides[0]:
        assert outcomes[0].failed_parts, "the part must have failed"


# Bad input, before a run starts

REFUSALS = {
    "steering filter@failure.effect=constant failure.effect.value=2":
        "Constant.value: must be from -0.6108 to 0.6108, the limits of steering, not 2",
    "drive filter@failure.effect=constant failure.effect.value=99": "the limits of speed, not 99",
    "drive failure/onset=waypoint failure.onset.number=99": "one of the 10 waypoints of the route",
    "drive failure/onset=place failure.onset.x_m=300": "in the world, which has x",
    "drive failure/onset=course failure.onset.unit=m failure.onset.latest=9999":
        "within the route, which is 88.3 m long",
    "steering filter@failure.effect=pose_drift": "PoseDrift: must filter a pose",
    "wheel failure.effect.value=1.5": "must be from 0 to 1, the limits of left wheel, not 1.5",
    "wheel filter@failure.effect=stuck": "must change the strength of a wheel",
    "wheel filter@failure.effect=pose_jump": "not wheel strengths (left, right)",
    "wheel failure.part=rear_wheel": "must be one of steering, drive, left_wheel, right_wheel",
    "random filter@failure.effect=pose_jump": "PoseJump: must filter a pose",
    "localization filter@failure.effect=limit": "Limit: must filter readings or a command",
    "localization filter@failure.effect=constant": "Constant: must filter readings or a command",
}  # fmt: skip


@pytest.mark.parametrize("typed", REFUSALS)
def test_faults_that_cannot_be_are_refused_in_one_line(typed: str) -> None:
    with pytest.raises(InputError) as refusal:
        preflight(configured(*f"failure={typed}".split()))
    assert REFUSALS[typed] in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_a_jump_is_one_of_the_pose_and_readings_have_a_bias() -> None:
    with pytest.raises(InputError) as refusal:
        preflight(configured("failure=random", "filter@failure.effect=pose_jump"))
    assert is_of(str(refusal.value), "evoros/filter/pose_jump.py failure=localization")
    preflight(configured("failure=localization", "filter@failure.effect=pose_jump"))
    preflight(configured("+filter@controller.localization.jump=pose_jump"))
    preflight(configured("failure=random", "filter@failure.effect=bias"))


def test_an_event_that_one_of_the_worlds_lacks_is_a_warning(caplog: Log) -> None:
    far = "failure=drive failure/onset=place failure.onset.x_m=20 failure.onset.y_m=0"
    experiment = configured(*far.split(), "failure.onset.radius_m=0.1")
    wide = replace(experiment.world["boxes"], course=square(waypoints=[[21.0, 0.0]]))
    preflight(replace(experiment, world={**experiment.world, "wide": wide}))
    assert "otherwise, the failure never occurs in boxes" in caplog.text
    assert "never occurs in wide" not in caplog.text


class Unstated(Failure):
    """Its fault is of a part that it does not state."""

    def draw(self, channels: Any, rng: Any) -> tuple[Fault, ...]:
        return (Fault(Silence(), np.zeros(1), signal=COMMAND),)


def test_a_failure_model_must_state_its_parts() -> None:
    experiment = configured("failure=none")
    scenario = replace(experiment.scenario, failure=Unstated())
    with pytest.raises(InputError, match="must include commands"):
        run_mission(scenario, first_mission(experiment))
