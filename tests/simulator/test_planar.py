"""The planar simulator against geometry: arcs, lags, contacts, and rays traced another way."""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from evoros.base.arrays import CONTACT, SPEED, STATE_SIZE, YAW, YAW_RATE, Array, X, Y
from evoros.base.compilation import ADVANCE, compile_rule
from evoros.config.compose import compose
from evoros.evolution.experiment import Experiment
from evoros.geometry.clearance import compute_clearances, summarize_track
from evoros.geometry.footprint import Footprint, project_bodies
from evoros.geometry.grid import Grid, cell_at
from evoros.geometry.outlines import Outlines
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.robot.model import Robot
from evoros.sensor.protocol import Mount
from evoros.sensor.sonar import Sonar
from evoros.simulator.engines.planar_rules import advance
from evoros.simulator.planar import Planar
from evoros.simulator.protocol import RuleSimulation
from evoros.world.model import World
from evoros.world.obstacles import outlines

calm = settings(deadline=None, max_examples=60)
speeds = st.floats(-0.39, 0.39)
steerings = st.floats(-0.6, 0.6)
coordinates = st.floats(-6.0, 6.0)
angles = st.floats(-math.pi, math.pi)
lengths = st.floats(0.05, 2.0)
shapes = st.one_of(
    st.builds(lambda x, y, z: Shape("box", (x, y, z)), lengths, lengths, lengths),
    st.builds(lambda r, h: Shape("cylinder", (r, h)), lengths, lengths),
    st.builds(lambda r: Shape("sphere", (r,)), lengths),
)
solids = st.builds(
    lambda shape, x, y, z, roll, pitch, yaw: (
        shape,
        Pose.from_rpy((x, y, z), roll, pitch, yaw),
    ),
    shapes,
    coordinates,
    coordinates,
    st.floats(0.0, 2.0),
    angles,
    angles,
    angles,
)


@cache
def experiment() -> Experiment:
    return compose(["simulator=planar"]).build()


def world_of(*placed: tuple[Shape, Pose]) -> World:
    """Level ground with these bodies; home far away, for some of them may lie anywhere."""
    world = experiment().world["boxes"]
    ground = [body for body in world.bodies if body.is_ground]
    bodies = [Body(f"body_{i}", pose, (shape,)) for i, (shape, pose) in enumerate(placed)]
    course = replace(world.course, home_x_m=90.0, home_yaw_rad=0.0, waypoints=((99.0, 99.0),))
    return replace(world, bodies=(*ground, *bodies), course=course)


def rover(*poses: tuple[float, float, float, float, float], **sonar: float) -> Robot:
    """The rover with sonars at x, y, z [m], yaw, pitch [deg]."""
    mounts = [Mount("sonar", "base_link", *pose) for pose in poses]
    return experiment().robot.with_sensors(mounts, {"sonar": Sonar(**sonar)})  # type: ignore[arg-type]


def started(
    world: World,
    robot: Robot | None = None,
    pose: Sequence[float] = (0.0, 0.0, 0.0),
    simulator: Planar | None = None,
) -> RuleSimulation:
    simulator = simulator or Planar(steering_lag_s=0.0, drive_lag_s=0.0)
    with simulator.open(robot or rover(), world) as simulation:
        simulation.memory[[X, Y, YAW]] = pose
        return simulation


def state_of(simulation: RuleSimulation) -> Array:
    state = np.zeros(STATE_SIZE)
    simulation.observe(state)
    return state


@calm
@given(speeds, steerings, st.integers(1, 20), angles)
def test_the_turning_point_drives_along_a_circle(
    speed: float, steering: float, ticks: int, yaw: float
) -> None:
    drive = experiment().robot.drive
    simulation = started(world_of(), pose=(1.0, 2.0, yaw))
    for _ in range(ticks):
        simulation.advance(np.array([speed, steering]), 0.1)
    state = state_of(simulation)
    steering = min(max(steering, -drive.steering_limit), drive.steering_limit)
    curvature = math.tan(steering) / drive.wheelbase_m
    turn, axle = speed * curvature * 0.1 * ticks, drive.rear_axle_x_m
    # In the frame of the turning point at its start: along (sin, 1 - cos) of the turn, by radius.
    along = math.sin(turn) / curvature if abs(curvature) > 1e-6 else speed * 0.1 * ticks
    aside = (1.0 - math.cos(turn)) / curvature if abs(curvature) > 1e-6 else 0.0
    x = 1.0 + axle * math.cos(yaw) + along * math.cos(yaw) - aside * math.sin(yaw)
    y = 2.0 + axle * math.sin(yaw) + along * math.sin(yaw) + aside * math.cos(yaw)
    final = yaw + turn
    assert state[X] == pytest.approx(x - axle * math.cos(final), abs=1e-6)
    assert state[Y] == pytest.approx(y - axle * math.sin(final), abs=1e-6)
    assert math.cos(state[YAW] - final) == pytest.approx(1.0, abs=1e-12)
    assert abs(state[YAW]) <= math.pi + 1e-12
    assert state[SPEED] == speed
    assert state[YAW_RATE] == pytest.approx(speed * curvature)


def test_arcs_do_not_depend_on_the_step() -> None:
    """Without lags every step is exact, however long."""
    ends = []
    for step in (0.1, 0.02, 0.005):
        simulation = started(world_of(), simulator=Planar(step, 0.0, 0.0))
        for tick in range(50):
            simulation.advance(np.array([0.3, 0.5 * math.sin(tick)]), 0.1)
        ends.append(state_of(simulation))
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-12)
    np.testing.assert_allclose(ends[0], ends[2], atol=1e-12)


def test_lags_are_of_first_order() -> None:
    """After one time constant, and after two: 1 - 1/e and 1 - 1/e^2 of the way."""
    drive = experiment().robot.drive
    simulation = started(world_of(), simulator=Planar(0.02, 0.1, 0.2))
    command = np.array([0.3, 0.4])
    for steering, speed in ((1, 0.5), (2, 1.0)):
        simulation.advance(command, 0.1)
        state = state_of(simulation)
        angle = 0.4 * -math.expm1(-steering)
        assert state[SPEED] == pytest.approx(0.3 * -math.expm1(-speed))
        expected = state[SPEED] * math.tan(angle) / drive.wheelbase_m
        assert state[YAW_RATE] == pytest.approx(expected)


def test_the_drive_is_limited() -> None:
    drive = experiment().robot.drive
    simulation = started(world_of())
    simulation.advance(np.array([9.0, 9.0]), 0.1)
    state = state_of(simulation)
    assert state[SPEED] == drive.max_speed_mps
    lock = math.tan(drive.steering_limit) / drive.wheelbase_m
    assert state[YAW_RATE] == pytest.approx(drive.max_speed_mps * lock)


@calm
@given(st.floats(0.3, 3.0), st.floats(-0.5, 0.5), st.sampled_from([0.005, 0.02, 0.05]))
def test_it_stops_at_a_wall_and_says_so(gap: float, tilt: float, step: float) -> None:
    """Closer than one step to it, and never beyond."""
    robot = rover()
    front = float(robot.outline[:, 0].max())
    wall = Shape("box", (0.2, 9.0, 0.5)), Pose((front + gap + 0.1, 0.0, 0.25))
    world = world_of(wall)
    simulation = started(world, robot, simulator=Planar(step, 0.0, 0.0))
    touched = []
    for _ in range(round((gap + 0.5) / 0.03)):
        simulation.advance(np.array([0.3, 0.0]), 0.1)
        touched.append(bool(state_of(simulation)[CONTACT]))
    state = state_of(simulation)
    first = touched.index(True)
    assert all(touched[first:])
    assert not any(touched[:first])
    left = front + gap - (state[X] + front)
    assert 0.0 <= left < 0.3 * step + 1e-9
    assert state[SPEED] == 0.0


def test_what_is_higher_than_the_robot_is_no_obstacle_to_it() -> None:
    robot = rover()
    for height, touched in ((robot.height_m - 0.01, True), (robot.height_m + 0.01, False)):
        beam = Shape("box", (0.2, 9.0, 0.1)), Pose((1.0, 0.0, height + 0.05))
        simulation = started(world_of(beam), robot)
        simulation.advance(np.array([0.39, 0.0]), 5.0)
        assert bool(state_of(simulation)[CONTACT]) is touched


def test_contact_is_that_of_the_outlines() -> None:
    """At random poses in a random field: contact where the clearance is 0."""
    rng = np.random.default_rng(3)
    field = [
        (Shape("box", (0.4, 0.6, 0.3)), Pose.from_rpy((x, y, 0.1), 0.3, 0.2, angle))
        for x, y, angle in rng.uniform(-4, 4, (40, 3))
    ]
    robot, world = rover(), world_of(*field)
    poses = rng.uniform((-4, -4, -3), (4, 4, 3), (400, 3))
    below = areas_of(world, robot)
    expected = compute_clearances(robot.outline, poses, below) == 0.0
    assert 50 < expected.sum() < 350
    simulation = started(world, robot)
    for pose, touches in zip(poses, expected, strict=True):
        simulation.memory[[X, Y, YAW]] = pose
        simulation.advance(np.zeros(2), 0.02)
        assert bool(state_of(simulation)[CONTACT]) == touches


def test_a_robot_that_reaches_farther_than_it_sees_meets_obstacles() -> None:
    """Without any sensor, and with an outline of more than a metre."""
    bare = experiment().robot.with_sensors([], {})
    robot = replace(bare, outline=4.0 * bare.outline)
    post = Shape("box", (0.2, 0.2, 0.5)), Pose((4.0, 0.0, 0.25))
    simulation = started(world_of(post), robot)
    simulation.advance(np.array([0.3, 0.0]), 20.0)
    state = state_of(simulation)
    assert state[CONTACT] == 1.0
    assert 3.9 - 0.3 * 0.02 <= state[X] + robot.outline[:, 0].max() <= 3.9


@pytest.mark.parametrize("compiling", [True, False])
@pytest.mark.parametrize("command", [(math.nan, 0.1), (0.3, math.nan)])
def test_a_command_that_is_no_number_loses_the_state(
    compiling: bool, command: tuple[float, float]
) -> None:
    """Which ends the mission as a failure, compiled or not; it is no error of Python's."""
    post = Shape("box", (0.2, 0.2, 0.5)), Pose((4.0, 0.0, 0.25))
    simulation = started(world_of(post), rover((0.2, 0.0, 0.166, 0.0, 12.5)))
    drive = compile_rule(advance, ADVANCE) if compiling else advance
    drive(simulation.parameters, simulation.memory, np.array(command), 0.1)
    simulation.sense(np.zeros(1))
    assert not np.isfinite(state_of(simulation)[[X, Y, YAW, SPEED]]).all()


def areas_of(world: World, robot: Robot) -> tuple[Footprint, ...]:
    return project_bodies(world.obstacles, robot.height_m)


def turned(yaw: float) -> Array:
    cos, sin = math.cos(yaw), math.sin(yaw)
    return np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])


def traced(world: World, pose: Sequence[float], robot: Robot) -> Array:
    """The readings by bisection along each ray, knowing only what is inside of a solid."""
    x, y, yaw = pose
    turn = turned(yaw)
    readings = []
    for mount, frame in zip(robot.mounts, robot.sensor_frames(), strict=True):
        sensor = robot.sensors[mount.sensor]
        start = turn @ frame[:3, 3] + (x, y, 0.0)
        rays = sensor.rays() @ (turn @ frame[:3, :3]).T
        best = sensor.range_max_m
        for ray in rays:
            for body in world.obstacles:
                hit = _first_inside(body, start, ray, best)
                best = min(best, hit)
            if start[2] + best * ray[2] < 0.0:
                best = -start[2] / ray[2]
        readings.append(max(best, sensor.range_min_m))
    return np.array(readings)


def _first_inside(body: Body, start: Array, ray: Array, best: float) -> float:
    """Least distance at which the ray is inside; infinity where it starts inside."""
    steps = np.arange(0.0, best + 0.002, 0.002)
    (shape,) = body.shapes
    local = (start + steps[:, None] * ray - body.pose.position) @ body.pose.rotation
    inside = _inside(shape, local)
    if inside[0] or not inside.any():
        return math.inf
    high = steps[inside.argmax()]
    low = high - 0.002
    for _ in range(40):
        middle = (low + high) / 2
        at = (start + middle * ray - body.pose.position) @ body.pose.rotation
        low, high = (low, middle) if _inside(shape, at[None])[0] else (middle, high)
    return float(high)


def _inside(shape: Shape, points: Array) -> NDArray[np.bool_]:
    squared = points * points
    if shape.kind == "box":
        found = np.abs(points) <= np.array(shape.size) / 2
    elif shape.kind == "sphere":
        found = squared.sum(axis=1, keepdims=True) <= shape.size[0] ** 2
    else:
        across = squared[:, :2].sum(axis=1) <= shape.size[0] ** 2
        found = np.stack([across, np.abs(points[:, 2]) <= shape.size[1] / 2], axis=1)
    return np.asarray(found.all(axis=1), dtype=np.bool_)


@settings(deadline=None, max_examples=80)
@given(st.lists(solids, max_size=6), coordinates, coordinates, angles, st.floats(-20.0, 30.0))
def test_readings_are_the_nearest_hits(
    placed: list[tuple[Shape, Pose]], x: float, y: float, yaw: float, pitch: float
) -> None:
    robot = rover((0.2, 0.1, 0.166, 30.0, pitch), (0.0, -0.15, 0.1, -90.0, 12.5), rays_per_axis=3)
    world = world_of(*placed)
    readings = np.zeros(2)
    simulation = started(world, robot, (x, y, yaw))
    simulation.sense(readings)
    expected = traced(world, (x, y, yaw), robot)
    # The tracing misses what is thinner along a ray than its step; it never sees what is not.
    assert (readings <= expected + 1e-9).all()
    nearer = readings < expected - 1e-9
    for reading, frame in zip(readings[nearer], robot.sensor_frames()[nearer], strict=True):
        assert _grazes(world, (x, y, yaw), frame, reading, robot)


def _grazes(
    world: World, pose: Sequence[float], frame: Array, reading: float, robot: Robot
) -> bool:
    """Whether at this distance along some ray a solid begins that the ray leaves very soon."""
    x, y, yaw = pose
    turn = turned(yaw)
    start = turn @ frame[:3, 3] + (x, y, 0.0)
    rays = robot.sensors["sonar"].rays() @ (turn @ frame[:3, :3]).T
    for body in world.obstacles:
        (shape,) = body.shapes
        grown = Shape(shape.kind, tuple(edge + 1e-6 for edge in shape.size))
        local = (start + reading * rays - body.pose.position) @ body.pose.rotation
        if _inside(grown, local).any():
            return True
    return False


def test_level_ground_is_seen_where_the_lowest_ray_meets_it() -> None:
    """From 0.166 m above ground; the lowest ray is the one at the lower corner of the beam."""
    readings = np.zeros(2)
    poses = ((0.2, 0.0, 0.166, 0.0, 12.5), (0.2, 0.0, 0.166, 0.0, 16.0))
    started(world_of(), rover(*poses)).sense(readings)
    edge, pitch = math.radians(15.0), math.radians(12.5)
    falls = math.cos(pitch) * math.sin(edge) - math.sin(pitch) * math.cos(edge) ** 2
    assert readings[0] == pytest.approx(0.166 / falls)
    assert readings[1] == 4.5


def test_a_sensor_inside_an_obstacle_does_not_see_it() -> None:
    around = Shape("box", (2.0, 2.0, 2.0)), Pose((0.0, 0.0, 0.5))
    ahead = Shape("box", (0.2, 2.0, 2.0)), Pose((3.1, 0.0, 1.0))
    readings = np.zeros(1)
    started(world_of(around, ahead), rover((0.2, 0.0, 0.166, 0.0, 16.0))).sense(readings)
    straight = 3.0 - 0.2
    assert straight <= readings[0] < straight / math.cos(math.radians(31.0))


@settings(deadline=None, max_examples=40)
@given(
    st.lists(st.tuples(coordinates, coordinates, lengths), max_size=30),
    st.floats(0.1, 5.0),
    st.tuples(st.floats(-20, 20), st.floats(-20, 20)),
)
def test_the_index_names_all_that_is_within_reach(
    discs: list[tuple[float, float, float]], reach: float, at: tuple[float, float]
) -> None:
    areas = [Footprint(np.array([[x, y]]), radius) for x, y, radius in discs]
    grid = Grid.around(areas, reach)
    starts, entries = grid.list_near(areas, reach)
    cell = cell_at(grid.to_array(), *at)
    named = set() if cell < 0 else set(entries[int(starts[cell]) : int(starts[cell + 1])].tolist())
    for name, (x, y, radius) in enumerate(discs):
        if math.hypot(x - at[0], y - at[1]) <= radius + reach - 1e-9:
            assert name in named
    if cell >= 0:  # and little more: what is within reach of the cell, not of the point
        far = 2.0 * grid.cell * math.sqrt(0.5) + 1e-9
        for name in named:
            x, y, radius = discs[int(name)]
            assert math.hypot(x - at[0], y - at[1]) <= radius + reach + far


@settings(deadline=None, max_examples=40)
@given(st.lists(solids, min_size=1, max_size=6), st.integers(0, 1000))
def test_the_least_clearance_is_that_of_all_poses(
    placed: list[tuple[Shape, Pose]], seed: int
) -> None:
    robot, world = rover(), world_of(*placed)
    rng = np.random.default_rng(seed)
    steps = rng.normal(0.0, (0.05, 0.05, 0.2), (300, 3))
    track = np.cumsum(steps, axis=0) + rng.uniform(-5, 5, 3)
    areas = outlines(world, robot.height_m)
    found = summarize_track(track, len(track), robot.outline, areas, np.array([[0.0, 0.0]]))
    each = compute_clearances(robot.outline, track, areas_of(world, robot))
    assert found.clearance == each.min()
    moved = np.diff(track[:, :2], axis=0)
    assert found.length == pytest.approx(np.hypot(moved[:, 0], moved[:, 1]).sum())
    assert found.point_distances[0] == pytest.approx(np.hypot(track[:, 0], track[:, 1]).min())


def test_without_obstacles_there_is_no_clearance() -> None:
    found = summarize_track(np.zeros((3, 3)), 3, rover().outline, Outlines.of([]), np.zeros((0, 2)))
    assert found.clearance == math.inf
    assert found.length == 0.0


def test_foundations_below_the_ground_are_no_obstacle() -> None:
    """Wholly below it; what stands out by a centimetre is one."""
    for depth, touched in ((0.30, False), (0.29, True)):
        slab = Shape("box", (0.2, 9.0, 0.3)), Pose((1.0, 0.0, 0.15 - depth))
        simulation = started(world_of(slab))
        simulation.advance(np.array([0.39, 0.0]), 5.0)
        assert bool(state_of(simulation)[CONTACT]) is touched


def test_a_long_wall_is_listed_only_where_it_is_near() -> None:
    """Not all over the circle around it."""
    wall = Footprint(np.array([[-50.0, 0.0], [50.0, 0.0], [50.0, 0.2], [-50.0, 0.2]]))
    grid = Grid.around([wall], 5.0)
    _, entries = grid.list_near([wall], 5.0)
    assert 100 * 10 < len(entries) < 112 * 13
