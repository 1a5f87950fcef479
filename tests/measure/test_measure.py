"""Measures of designs whose coverage, spread and price are known by geometry."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from bundled_parts import every
from fixture_types import Log
from hypothesis import given, settings
from hypothesis import strategies as st

from evoros.base.errors import InputError
from evoros.config.compose import compose
from evoros.design.design import Design
from evoros.evolution.experiment import Experiment
from evoros.evolution.trials import Measuring, equip_robots
from evoros.fitness.equation_one import EquationOne
from evoros.fitness.scoring import Scoring
from evoros.measure.cost import Cost
from evoros.measure.coverage import Coverage
from evoros.measure.function import Function
from evoros.measure.least_coverage import LeastCoverage
from evoros.measure.mass import Mass
from evoros.measure.protocol import Evaluated, Measure
from evoros.measure.redundancy import Redundancy
from evoros.measure.sensor_number import SensorNumber
from evoros.measure.spread import Spread
from evoros.measure.worst_failure import WorstFailure
from evoros.measure.worst_world import WorstWorld
from evoros.mission.mission import Outcome
from evoros.preflight.preflight import check_measures
from evoros.robot.seen import BEARINGS_DEG, find_seen
from evoros.sensor.lidar import Lidar
from evoros.sensor.protocol import Mount, Sensor
from evoros.sensor.sonar import Sonar
from evoros.testing import MeasureSuite

TYPES: Mapping[str, Sensor] = {"lidar": Lidar(), "sonar": Sonar(fov_deg=30.0)}


@cache
def bundled() -> Experiment:
    return compose(["simulator=planar", "executor=serial"]).build()


def mount(kind: str, yaw: float, x: float = 0.0, y: float = 0.0) -> Mount:
    return Mount(kind, bundled().robot.mount_link, x, y, 0.1, yaw, 0.0)


def evaluated(
    mounts: Sequence[Mount], trials: Sequence[Sequence[Outcome]] = (), fitness: float = 0.0
) -> Evaluated:
    robot = bundled().robot.with_sensors(mounts, TYPES)
    of_robots = [[(outcome,) for outcome in trial] for trial in trials]
    score = Scoring(EquationOne()).score_trial
    return Evaluated(Design(tuple(mounts)), {"": robot}, of_robots, fitness, score)


def at_middle(yaws: Sequence[float], kind: str = "sonar") -> Evaluated:
    """Sensors in the middle of the robot, so that each covers exactly its beam."""
    robot = bundled().robot
    outline = robot.outline
    x, y = ((outline.min(axis=0) + outline.max(axis=0)) / 2).tolist()
    base_x, base_y, *_ = robot.sensor_links[robot.mount_link]
    return evaluated([mount(kind, yaw, x - base_x, y - base_y) for yaw in yaws])


def outcome(progress: float, completed: bool = False) -> Outcome:
    failed = Outcome.failure("time_limit", "", 100.0, 6)
    return replace(failed, progress=progress, completed=completed, time_s=50.0)


class TestBundledMeasures(MeasureSuite):
    choose = every("measure")


FRONT = Coverage(bearing_deg=0.0, width_deg=90.0)
SIDES = Coverage(bearing_deg=90.0, width_deg=90.0, both_sides=True)


def test_a_beam_covers_its_opening_as_a_share_of_the_sector() -> None:
    assert Coverage().compute(at_middle([0.0])) == 30 / 360
    assert FRONT.compute(at_middle([0.0])) == 30 / 90
    assert FRONT.compute(at_middle([45.0])) == 15 / 90
    assert SIDES.compute(at_middle([90.0])) == 30 / 180
    assert SIDES.compute(at_middle([0.0, 180.0])) == 0.0
    assert Coverage().compute(at_middle([180.0])) == 30 / 360  # across the back


def test_a_lidar_all_around_covers_everything_within_its_range() -> None:
    assert Coverage().compute(at_middle([77.0], "lidar")) == 1.0
    assert Coverage(distance_m=8.1).compute(at_middle([0.0], "lidar")) == 0.0
    assert Coverage(distance_m=4.6).compute(at_middle([0.0])) == 0.0
    assert Coverage(distance_m=0.05).compute(at_middle([0.0])) == 0.0


RAYS = [
    Sonar(rays_per_axis=1),
    Sonar(rays_per_axis=3, fov_deg=0.1),
    Lidar(beams=1),
    Lidar(beams=2, fov_deg=0.5),
]


@settings(deadline=None)
@given(
    st.sampled_from(RAYS),
    st.floats(-180.0, 180.0),
    st.floats(-0.2, 0.2),
    st.floats(-0.15, 0.15),
    st.floats(0.5, 4.0),
)
def test_a_single_ray_sees_the_degree_in_which_it_looks(
    sensor: Sensor, yaw: float, x: float, y: float, distance: float
) -> None:
    """Its end at the distance lies in that degree about the middle of the robot."""
    types = {"ray": sensor}
    robot = bundled().robot.with_sensors([mount("ray", yaw, x, y)], types)
    (seen,) = find_seen(robot, distance)
    (bearing,) = BEARINGS_DEG[seen]
    outline = robot.outline
    place = robot.sensor_poses[0, :2] - (outline.min(axis=0) + outline.max(axis=0)) / 2
    along = np.array([math.cos(math.radians(yaw)), math.sin(math.radians(yaw))])
    part = float(place @ along)
    reach = -part + math.sqrt(part * part - float(place @ place) + distance * distance)
    end = place + reach * along
    off = math.degrees(math.atan2(end[1], end[0])) - bearing
    assert abs((off + 180.0) % 360.0 - 180.0) <= 0.5 + 1e-6


def test_single_rays_tell_designs_apart_before_a_run() -> None:
    """A coverage that ignored them would be constant, which is refused."""
    more = ["design.sensors.sonar.rays_per_axis=1", "+measure@descriptors.front=front_coverage"]
    experiment = compose(["simulator=planar", "executor=serial", *more]).build()
    assert list(check_measures(experiment)) == []


def test_the_least_coverage_is_that_after_the_worst_loss() -> None:
    apart = at_middle([0.0, 60.0, 120.0, 180.0])
    assert LeastCoverage().compute(apart) == 90 / 360
    assert LeastCoverage(failed=2).compute(apart) == 60 / 360
    assert LeastCoverage().compute(at_middle([0.0, 0.0, 90.0])) == 30 / 360  # loses the single one
    assert LeastCoverage().compute(at_middle([0.0])) == 0.0
    assert LeastCoverage(failed=3).compute(at_middle([])) == 0.0


def test_redundancy_is_what_two_beams_share() -> None:
    assert Redundancy().compute(at_middle([0.0, 10.0])) == 20 / 360
    assert Redundancy().compute(at_middle([0.0, 10.0, 10.0])) == 30 / 360
    assert Redundancy().compute(at_middle([0.0, 90.0])) == 0.0


@settings(deadline=None, max_examples=30)
@given(st.lists(st.integers(-180, 179), min_size=1, max_size=5), st.integers(0, 4))
def test_coverage_obeys_the_laws_of_sets(yaws: list[int], lost: int) -> None:
    whole = at_middle(list(map(float, yaws)))
    covered = Coverage().compute(whole)
    mirrored = at_middle([-float(yaw) for yaw in yaws])
    assert Coverage().compute(mirrored) == covered
    assert SIDES.compute(mirrored) == SIDES.compute(whole)
    assert Redundancy().compute(whole) <= covered
    fewer = [float(yaw) for i, yaw in enumerate(yaws) if i != lost % len(yaws)]
    assert LeastCoverage().compute(whole) <= Coverage().compute(at_middle(fewer)) <= covered


def test_spread_is_a_share_of_half_the_diagonal() -> None:
    outline = bundled().robot.outline
    half = math.hypot(*(outline.max(axis=0) - outline.min(axis=0)).tolist()) / 2
    pair = evaluated([mount("sonar", 0.0, 0.1, 0.0), mount("sonar", 90.0, -0.1, 0.0)])
    assert Spread().compute(pair) == pytest.approx(0.1 / half, rel=1e-12)
    assert Spread().compute(evaluated([mount("sonar", 0.0, 0.2)])) == 0.0
    assert Spread().compute(evaluated([])) == 0.0


def test_number_cost_and_mass_are_sums() -> None:
    both = evaluated([mount("sonar", 0.0), mount("sonar", 9.0), mount("lidar", 0.0)])
    assert SensorNumber().compute(both) == 3
    assert Cost().compute(both) == 2 * Sonar().price + Lidar().price
    assert Mass().compute(both) == pytest.approx(2 * Sonar().mass_kg + Lidar().mass_kg)


def test_the_worst_world_and_the_worst_failures_are_those_of_equation_one() -> None:
    trials = [[outcome(1.0), outcome(0.0)], [outcome(0.5), outcome(1.0)]]  # 4, 1 and 2.25, 4
    design = evaluated([], trials)
    assert WorstWorld().compute(design) == (1.0 + 4.0) / 2  # the first one has 3.125
    assert WorstFailure().compute(design) == 2.25 + 1.0
    assert WorstFailure().compute(evaluated([], trials[:1])) == EquationOne().score(trials[0])
    assert WorstFailure().compute(evaluated([], trials * 4)) == 2.25 + 1.0  # not lower by number


def test_a_team_counts_the_sensors_of_all_and_covers_by_one() -> None:
    one, two = (at_middle(yaws).robots[""] for yaws in ([0.0], [0.0, 90.0]))
    team = Evaluated(
        Design(()), {"": one, "other": two}, (), 0.0, Scoring(EquationOne()).score_trial
    )
    assert SensorNumber().compute(team) == 3
    assert Coverage().compute(team) == 30 / 360
    assert Coverage(robot="other").compute(team) == 60 / 360
    with pytest.raises(InputError, match="robot: must be the name of a robot") as caught:
        Coverage(robot="third").compute(team)
    assert "\n" not in str(caught.value)


# In an experiment


def with_descriptor(measure: Measure, *overrides: str):  # type: ignore[no-untyped-def]
    experiment = compose(["simulator=planar", "executor=serial", *overrides]).build()
    return replace(experiment, descriptors={"one": measure})


def by(function: Callable[[Evaluated], float], of_design: bool = False) -> Function:
    return Function(function, "what", (2.0, 3.0), of_design=of_design)


def test_a_descriptor_that_is_constant_is_found_before_the_run() -> None:
    with pytest.raises(InputError, match=r"descriptors\.one: must differ") as caught:
        list(check_measures(with_descriptor(SensorNumber())))
    assert "\n" not in str(caught.value)
    assert not list(check_measures(with_descriptor(SensorNumber(), "design=free_sonars")))
    with pytest.raises(
        InputError, match=r"descriptors\.one: Function\.compute must return a finite"
    ):
        list(check_measures(with_descriptor(by(lambda _: math.nan, of_design=True))))


def test_what_is_no_number_in_a_run_is_told_once_and_counts_as_the_worst(caplog: Log) -> None:
    experiment = with_descriptor(by(lambda one: math.nan if one.fitness < 5 else one.fitness))
    measuring = Measuring(experiment)
    design = experiment.space.decode(np.full(experiment.space.size, 0.5))
    scores = [measuring.score("selection", 1, design, fitness) for fitness in (3.0, 12.0, 4.0)]
    assert [score.descriptor for score in scores] == [(2.0,), (12.0,), (2.0,)]
    assert len([r for r in caplog.records if "descriptors.one" in r.message]) == 1


def test_a_design_that_a_part_refuses_has_its_sensors() -> None:
    key = "controller.avoidance.range_m"
    design = Design((mount("sonar", 0.0),), {key: -1.0})
    assert len(equip_robots(bundled().scenario, design)[""].mounts) == 1
