"""The sensors of both rigid-body engines, against geometry."""

import math
from dataclasses import replace

import pytest
from pybullet_cases import beam, box, level, mission, mount_sensors
from rigid_cases import ENGINES, Rigid, ranges

from evoros.evolution.experiment import Experiment
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.mission.rollout import run_mission
from evoros.sensor.sonar import Sonar
from evoros.simulator.planar import Planar

pytestmark = pytest.mark.usefixtures("closed_engines")


@pytest.fixture(params=ENGINES)
def simulator(request: pytest.FixtureRequest) -> Rigid:
    kind: type[Rigid] = request.param
    return kind()


@pytest.mark.parametrize("yaw", [-120, -30, 0, 45, 180])
def test_a_wall_is_seen_where_it_is(simulator: Rigid, experiment: Experiment, yaw: float) -> None:
    turn = math.radians(yaw)
    center = (2.5 * math.cos(turn), 2.5 * math.sin(turn), 1.0)
    wall = Body("wall", Pose.from_rpy(center, 0, 0, turn), (Shape("box", (1.0, 4.0, 2.0)),))
    at = (0.2 * math.cos(turn), 0.2 * math.sin(turn))
    robot = mount_sensors(experiment, beam(), (*at, 0.3, yaw, 0), (*at, 0.3, yaw, 20))
    level_ray, raised = ranges(simulator, robot, level(experiment, wall))
    assert level_ray == pytest.approx(1.8, abs=1e-3)
    assert raised == pytest.approx(1.8 / math.cos(math.radians(20)), abs=1e-3)


@pytest.mark.parametrize("pitch", [-10, -35, -80])
def test_the_ground_is_seen(simulator: Rigid, experiment: Experiment, pitch: float) -> None:
    robot = mount_sensors(experiment, beam(), (0.25, 0.0, 0.4, 30, pitch))
    expected = 0.4 / math.sin(math.radians(-pitch))
    assert ranges(simulator, robot, level(experiment))[0] == pytest.approx(expected, rel=1e-3)


def test_a_cone_reads_its_nearest_ray(simulator: Rigid, experiment: Experiment) -> None:
    """The lowest rays point 2.5 deg below the horizon, those to the side farthest from ahead."""
    robot = mount_sensors(experiment, Sonar(range_max_m=20.0), (0.25, 0.0, 0.166, 0, 12.5))
    yaw, dip = math.radians(15), math.radians(-15)
    nose = math.radians(12.5)
    rays = [
        math.sin(nose) * math.cos(side) * math.cos(dip) + math.cos(nose) * math.sin(dip)
        for side in (0.0, yaw / 2, yaw)
    ]
    steepest = min(rays)
    assert ranges(simulator, robot, level(experiment), 1.0)[0] == pytest.approx(
        -0.166 / steepest, rel=1e-2
    )


def test_round_shapes_are_seen(simulator: Rigid, experiment: Experiment) -> None:
    ball = Body("ball", Pose((2.0, 0.0, 0.5)), (Shape("sphere", (0.5,)),))
    pole = Body("pole", Pose((0.0, 2.0, 1.0)), (Shape("cylinder", (0.3, 2.0)),))
    robot = mount_sensors(experiment, beam(), (0, 0, 0.5, 0, 0), (0, 0, 0.5, 90, 0))
    assert ranges(simulator, robot, level(experiment, ball, pole)) == pytest.approx(
        [1.5, 1.7], abs=1e-3
    )


def test_readings_stay_in_the_range(simulator: Rigid, experiment: Experiment) -> None:
    world = level(experiment, box("wall", 1.0))
    sensor = beam(range_max_m=0.8, range_min_m=0.4)
    robot = mount_sensors(
        experiment, sensor, (0.2, 0, 0.3, 0, 0), (-0.4, 0, 0.3, 0, 0), (0, 0, 0.3, 0, 0)
    )
    near, far, between = ranges(simulator, robot, world)
    assert near == 0.4
    assert far == 0.8
    assert between == pytest.approx(0.5, abs=1e-3)


CUBE = tuple((x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5))
SOLIDS = {
    "box": Shape("box", (1.0, 1.0, 1.0)),
    "sphere": Shape("sphere", (0.6,)),
    "cylinder": Shape("cylinder", (0.6, 1.0)),
    "convex": Shape("convex", (), corners=CUBE),
}


@pytest.mark.parametrize("kind", SOLIDS)
def test_a_ray_does_not_see_the_shapes_that_it_starts_in(
    simulator: Rigid, experiment: Experiment, kind: str
) -> None:
    """Like in the plane, it sees what is beyond, here a wall and the ground, or nothing."""
    rays = [(0, 0), (90, 0), (20, 0), (200, 0), (10, 60), (10, -60)]
    robot = mount_sensors(experiment, beam(), *((1.5, 0.0, 0.5, *ray) for ray in rays))
    sees = mount_sensors(experiment, beam(), (0.4, 0.0, 0.5, 0, 0))
    for mass, moments in ((None, None), (50.0, (1.0, 1.0, 1.0))):
        around = Body("around", Pose((1.5, 0.0, 0.6)), (SOLIDS[kind],), mass, inertia=moments)
        within = Body("within", Pose((1.5, 0.0, 0.6)), (Shape("sphere", (0.3,)),))
        world = level(experiment, around, within, box("wall", 4.0, size=(1, 4, 4)))
        readings, plane = ranges(simulator, robot, world), ranges(Planar(), robot, world)
        assert plane == pytest.approx([2.0, 4.5, 2.0 / math.cos(math.radians(20)), 4.5, 4.5, 0.577],
                                      abs=1e-3)  # fmt: skip
        assert readings == pytest.approx(plane, abs=1e-3)
        assert ranges(simulator, sees, world) == pytest.approx(
            ranges(Planar(), sees, world), abs=2e-3
        )


def test_the_ground_is_seen_around_obstacles(simulator: Rigid, experiment: Experiment) -> None:
    """MuJoCo overlooks ground that touches nothing by itself, in directions without an obstacle."""
    robot = mount_sensors(experiment, beam(), (0.25, 0.0, 0.4, 10, -60), (-0.3, 0, 0.4, 180, -30))
    readings = ranges(simulator, robot, level(experiment, box("wall", 4.0, size=(1, 4, 4))))
    assert readings == pytest.approx([0.4 / math.sin(math.radians(60)), 0.8], abs=1e-3)


def test_a_robot_sees_the_outside_of_its_body(simulator: Rigid, experiment: Experiment) -> None:
    """Its front from ahead, nothing over the cage, and its left side, past the wheels within."""
    rays = [(0.35, 0.0, 0.1, 180, 0), (0.15, 0.0, 0.3, 180, -10), (0.0, 0.3, 0.06, -90, 0)]
    robot = mount_sensors(experiment, beam(range_max_m=1.0), *rays)
    assert ranges(simulator, robot, level(experiment)) == pytest.approx([0.1, 1.0, 0.1375])


def test_more_rays_than_one_call_takes(simulator: Rigid, experiment: Experiment) -> None:
    dense = Sonar(rays_per_axis=81, fov_deg=10.0)
    poses = [(0.0, 0.0, 1.0, yaw, 0.0) for yaw in (0, 90, 180, 270)]
    robot = mount_sensors(experiment, dense, *poses)
    walls = [box("ahead", 2.5, size=(1, 3, 3)), box("left", 0.0, 3.5, size=(3, 1, 3))]
    assert 4 * 81 * 81 > 16_383
    expected = [2.0, 3.0, 4.5, 4.5]
    assert ranges(simulator, robot, level(experiment, *walls)) == pytest.approx(expected, abs=1e-3)


def test_a_mission_without_sensors_runs(simulator: Rigid, experiment: Experiment) -> None:
    wanted = mission(experiment, "maze")
    (outcome,), rows = run_mission(
        replace(experiment.scenario, simulator=simulator),
        replace(wanted, design=replace(wanted.design, mounts=())),
    )
    assert outcome.sensors == 0
    assert outcome.distance_m > 1.0
    assert outcome.avoiding == 0.0
    assert rows.shape[1] == 9
