"""Opens evoros and its peers with one scene: a lidar robot that circles among discs."""

import json
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

STEP_S, STEPS_PER_SCAN, RANGE_M = 0.02, 5, 5.0
SPEED_MPS, TURN_RADPS = 0.3, 0.3  # a circle with a radius of 1 m
RADIUS_M, DISC_M = 0.2, 0.15
CLEAR_M = 2.0  # half width of the free square in the middle
DENSITY = 0.4  # discs per square metre around it


@dataclass(frozen=True)
class Scene:
    """The beams of the lidar and the number of discs."""

    beams: int
    discs: int

    def place_discs(self) -> NDArray[np.float64]:
        """Return the centres (discs, 2) of the discs [m], outside the free square."""
        half = math.sqrt(self.discs / DENSITY + (2 * CLEAR_M) ** 2) / 2
        rng, found = np.random.default_rng(1), np.empty((0, 2))
        while len(found) < self.discs:
            drawn = rng.uniform(-half, half, (self.discs + 8, 2))
            found = np.vstack([found, drawn[np.abs(drawn).max(axis=1) > CLEAR_M]])
        return found[: self.discs]

    @property
    def angles(self) -> NDArray[np.float64]:
        """Return the bearings (beams,) [rad] of the beams, from right to left."""
        return (np.arange(self.beams) + 0.5) * math.tau / self.beams - math.pi

    def scan_exactly(self) -> NDArray[np.float64]:
        """Return the exact ranges (beams,) [m] from the origin."""
        rays = np.column_stack([np.cos(self.angles), np.sin(self.angles)])
        ranges = np.full(self.beams, RANGE_M)
        for centre in self.place_discs():
            along = rays @ centre
            aside = centre @ centre - along**2
            hit = (along > 0) & (aside < DISC_M**2)
            ranges[hit] = np.minimum(ranges[hit], along[hit] - np.sqrt(DISC_M**2 - aside[hit]))
        return ranges


Peer = tuple[Callable[[int], Any], NDArray[np.float64]]
"""A function that simulates a number of scans, and the first scan."""


def open_evoros(scene: Scene) -> Peer:
    """Compile the rules of the plane, which need no records."""
    from numba import njit

    from evoros.compilation.rules import SIMULATION_RULES, compile_rule
    from evoros.config.compose import compose
    from evoros.geometry.shapes import Body, Pose, Shape
    from evoros.sensor.lidar import Lidar
    from evoros.sensor.protocol import Mount
    from evoros.simulator.protocol import RuleSimulation, open_alone
    from evoros.world.model import World

    experiment = compose(["simulator=planar", "robot=two_wheeler"]).build()
    kind = Lidar(range_min_m=0.0, range_max_m=RANGE_M, beams=scene.beams)
    mount = Mount("lidar", experiment.robot.mount_link, 0.0, 0.0, 0.2, 0.0, 0.0)
    robot = experiment.robot.with_sensors([mount], {"lidar": kind})
    shape = Shape("cylinder", (DISC_M, 1.0))
    first = next(iter(experiment.world.values()))
    course = replace(first.course, home_x_m=0.0, home_y_m=0.0, home_yaw_rad=0.0)
    bodies = [body for body in first.bodies if body.is_ground]
    bodies += [
        Body(f"disc{i}", Pose.from_rpy((x, y, 0.5), 0.0, 0.0, 0.0), (shape,))
        for i, (x, y) in enumerate(scene.place_discs().tolist())
    ]
    world = World("discs", tuple(bodies), course, "discs", f"{scene}")

    @njit
    def run(sense, advance, parameters, memory, readings, command, scans):  # type: ignore[no-untyped-def]
        for _ in range(scans):
            sense(parameters, memory, readings)
            advance(parameters, memory, command, STEP_S * STEPS_PER_SCAN)

    stack = open_alone(experiment.simulator.open, robot, world)
    simulation = stack.__enter__()
    assert isinstance(simulation, RuleSimulation)
    _, sense, advance = map(compile_rule, simulation.rules, SIMULATION_RULES)
    readings, command = np.zeros(scene.beams), np.array([SPEED_MPS, TURN_RADPS])
    parts = (sense, advance, simulation.parameters, simulation.memory, readings, command)
    run(*parts, 1)
    return lambda scans: (stack, run(*parts, scans)), readings.copy()


def open_navground(scene: Scene) -> Peer:
    """Follow a square of waypoints, and scan by a call of Python.

    A world updates its sensors only for behaviours with a sensing state, which none of the compiled
    ones has: ``world.run`` alone takes the same time for 10 and for 1,000 beams.
    """
    from navground import core, sim

    world = sim.World()
    for x, y in scene.place_discs().tolist():
        world.add_obstacle(sim.Obstacle(core.Disc((x, y), DISC_M)))
    kinematics = core.kinematics.TwoWheelsDifferentialDriveKinematics(SPEED_MPS, 2 * RADIUS_M)
    corners = [(1.0, -1.0), (1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0)]
    task = sim.tasks.WaypointsTask(corners, loop=True, tolerance=0.1)
    angles = scene.angles
    lidar = sim.state_estimations.LidarStateEstimation(
        range=RANGE_M,
        start_angle=float(angles[0]),
        field_of_view=float(angles[-1] - angles[0]),
        resolution=scene.beams,
    )
    behavior = core.behaviors.DummyBehavior(kinematics, RADIUS_M)
    agent = sim.Agent(RADIUS_M, behavior, kinematics, task, [lidar], STEP_S * STEPS_PER_SCAN)
    world.add_agent(agent)
    world.update(0.0)
    state = core.SensingState()
    lidar.prepare_state(state)
    lidar.update(agent, world, state)
    scan = np.array(lidar.read_ranges(state))

    def run(scans: int) -> None:
        for _ in range(scans):
            lidar.update(agent, world, state)
            world.run(STEPS_PER_SCAN, STEP_S)

    return run, scan.astype(float)


def open_mujoco(scene: Scene) -> Peer:
    """Cast the rays and detect contacts with bare calls, at a pose that is set."""
    import mujoco

    discs = "".join(
        f'<geom type="cylinder" size="{DISC_M} 0.5" pos="{x} {y} 0.5"/>'
        for x, y in scene.place_discs().tolist()
    )
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="{STEP_S}" gravity="0 0 0"/><worldbody>{discs}'
        f'<body name="robot" pos="0 0 0.2"><joint type="slide" axis="1 0 0"/>'
        f'<joint type="slide" axis="0 1 0"/><joint type="hinge" axis="0 0 1"/>'
        f'<geom type="cylinder" size="{RADIUS_M} 0.1" mass="1"/></body></worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    robot, geom = model.body("robot").id, np.zeros(scene.beams, np.int32)
    local = np.column_stack([np.cos(scene.angles), np.sin(scene.angles), np.zeros(scene.beams)])
    ranges, pose = np.zeros(scene.beams), [0.0]

    def scan() -> None:
        c, s = math.cos(pose[0]), math.sin(pose[0])
        rays = (local @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])).ravel()
        origin = np.array([data.qpos[0], data.qpos[1], 0.2])
        mujoco.mj_multiRay(
            model, data, origin, rays, None, 1, robot, geom, ranges, None, scene.beams, RANGE_M
        )

    def run(scans: int) -> None:
        for _ in range(scans):
            scan()
            for _ in range(STEPS_PER_SCAN):
                pose[0] += STEP_S * TURN_RADPS
                data.qpos[:] = (math.sin(pose[0]), 1.0 - math.cos(pose[0]), pose[0])
                mujoco.mj_step1(model, data)

    mujoco.mj_forward(model, data)
    scan()
    return run, np.where(ranges < 0, RANGE_M, np.minimum(ranges, RANGE_M))


def open_pybullet(scene: Scene) -> Peer:
    """Cast the rays in a batch on one thread, at a pose that is set."""
    import pybullet as engine

    client = engine.connect(engine.DIRECT)
    disc = engine.createCollisionShape(engine.GEOM_CYLINDER, radius=DISC_M, height=1.0)
    for x, y in scene.place_discs().tolist():
        engine.createMultiBody(0, disc, basePosition=(x, y, 0.5), physicsClientId=client)
    shape = engine.createCollisionShape(engine.GEOM_CYLINDER, radius=RADIUS_M, height=0.1)
    robot = engine.createMultiBody(1, shape, basePosition=(0, 0, 0.8))
    rays = RANGE_M * np.column_stack([np.cos(scene.angles), np.sin(scene.angles)])
    ranges, pose = np.zeros(scene.beams), [0.0]

    def scan() -> None:
        x, y = math.sin(pose[0]), 1.0 - math.cos(pose[0])
        c, s = math.cos(pose[0]), math.sin(pose[0])
        ends = np.column_stack(
            [rays @ np.array([[c, s], [-s, c]]) + (x, y), np.full(scene.beams, 0.2)]
        )
        starts = np.tile((x, y, 0.2), (scene.beams, 1))
        hits: list[Any] = []
        limit = engine.MAX_RAY_INTERSECTION_BATCH_SIZE - 1
        for i in range(0, scene.beams, limit):
            hits += engine.rayTestBatch(starts[i : i + limit], ends[i : i + limit], 1)
        ranges[:] = [RANGE_M * hit[2] for hit in hits]

    def run(scans: int) -> None:
        for _ in range(scans):
            scan()
            for _ in range(STEPS_PER_SCAN):
                pose[0] += STEP_S * TURN_RADPS
                place = (math.sin(pose[0]), 1.0 - math.cos(pose[0]), 0.8)
                turned = engine.getQuaternionFromEuler((0, 0, pose[0]))
                engine.resetBasePositionAndOrientation(robot, place, turned)
                engine.performCollisionDetection()

    scan()
    return run, ranges.copy()


def open_irsim(scene: Scene) -> Peer:
    """Step the whole environment, which scans at every step."""
    import tempfile

    import irsim

    half = float(np.abs(scene.place_discs()).max(initial=CLEAR_M)) + 1.0
    spacing = math.tau / scene.beams
    robot = {
        "kinematics": {"name": "diff"},
        "shape": {"name": "circle", "radius": RADIUS_M},
        "state": [0, 0, 0],
        "goal": [1e6, 0, 0],
        "vel_min": [-1, -1],
        "vel_max": [1, 1],
        "sensors": [
            {
                "name": "lidar2d",
                "range_min": 0,
                "range_max": RANGE_M,
                "angle_range": math.tau - spacing,
                "number": scene.beams,
            }
        ],
    }
    discs = [
        {"shape": {"name": "circle", "radius": DISC_M}, "state": [x, y, 0]}
        for x, y in scene.place_discs().tolist()
    ]
    size = {"height": 2 * half, "width": 2 * half, "offset": [-half, -half]}
    content = {
        "world": {**size, "step_time": STEP_S * STEPS_PER_SCAN, "collision_mode": "unobstructed"},
        "robot": [robot],
        "obstacle": discs,
    }
    with tempfile.NamedTemporaryFile("w", suffix=".yaml") as file:
        json.dump(content, file)  # JSON is YAML
        file.flush()
        env = irsim.make(file.name, display=False, log_level="ERROR")
    command = np.array([[SPEED_MPS], [TURN_RADPS]])

    def run(scans: int) -> None:
        for _ in range(scans):
            env.step(command)

    return run, np.array(env.get_lidar_scan()["ranges"], float)


PEERS: dict[str, Callable[[Scene], Peer]] = {
    "evoros": open_evoros,
    "navground": open_navground,
    "ir-sim": open_irsim,
    "mujoco": open_mujoco,
    "pybullet": open_pybullet,
}
