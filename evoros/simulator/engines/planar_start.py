"""The parameters and the memory with which a mission in the plane starts."""

import math
from collections.abc import Sequence

import numpy as np

from evoros.base.arrays import Array
from evoros.base.packing import pack
from evoros.robot.model import Robot
from evoros.robot.rays import DIRECTION
from evoros.simulator.engines import planar_layout as layout
from evoros.simulator.engines.planar_beams import FREE_RANGE, beam_rows, group_rows
from evoros.simulator.engines.planar_bodies import find_movables, place_bodies
from evoros.simulator.engines.planar_layout import Drive, Hull, Memory, Plane, Sight, place_robot
from evoros.simulator.engines.planar_probes import list_probes
from evoros.simulator.engines.planar_shapes import list_shapes
from evoros.simulator.engines.planar_walkers import place_crowd
from evoros.simulator.engines.rays import sensor_beams
from evoros.simulator.engines.servos import lag_gain
from evoros.simulator.engines.steered_sight import lay_out_steered_sight
from evoros.simulator.protocol import PlacedRobot
from evoros.world.model import World
from evoros.world.obstacles import obstacle_arrays, world_arrays


def lay_out(
    robots: Sequence[PlacedRobot], world: World, time_step: float, lags: tuple[float, float]
) -> tuple[Array, Array]:
    """Return the parameters and the memory; ``lags`` [s] are of steering and drive."""
    tallest = max(robot.height_m for robot, _ in robots)
    gains = lag_gain(time_step, lags[0]), lag_gain(time_step, lags[1])
    shapes, faces, counts = list_shapes([robot for robot, _ in robots])
    places, packed = [np.zeros(layout.PLACES)], []
    for (robot, _), count in zip(robots, counts, strict=True):
        hull, sight = _lay_out_surroundings(robot, world, tallest)
        probes = list_probes(robot, world.gravity_mps2)
        packed.append((pack(hull), pack(sight), pack(probes)))
        sizes = [*map(len, packed[-1]), robot.signal_count, len(hull.outline), len(probes.contact)]
        places.append(places[-1] + [*sizes, count])
    hulls, sights, probe_rows = map(np.concatenate, zip(*packed, strict=True))
    drives = np.array([_describe_drive(robot, gains) for robot, _ in robots])
    _, movables = find_movables(world, tallest)
    placed = place_bodies(movables)
    if world.crowd is not None:
        movables = movables._replace(walk=world.crowd.parameters)
        placed = place_crowd(placed, world.crowd, len(robots))
    rows = hulls, sights, probe_rows, shapes, faces, pack(movables)
    memory = Memory(
        np.zeros((len(robots), layout.MOTION_SIZE)),
        np.zeros((int(places[-1][layout.CORNERS]), 2)),
        np.zeros(int(places[-1][layout.TOUCHES])),
        np.zeros_like(shapes),
        pack(placed),
    )
    for index, (_, (x, y, _, yaw)) in enumerate(robots):
        place_robot(memory, index, x, y, yaw)
    return pack(Plane(time_step, drives, np.array(places), *rows)), pack(memory)


def _describe_drive(robot: Robot, gains: tuple[float, float]) -> Drive:
    drive = robot.drive
    return Drive(
        gains[0] if drive.steering_joints else 1.0,
        gains[1],
        drive.max_speed_mps,
        drive.speed_limit_offset_m,
        drive.steering_limit,
        drive.wheelbase_m / drive.turn_ratio,
        drive.rear_axle_x_m,
    )


def _lay_out_surroundings(robot: Robot, world: World, tallest: float) -> tuple[Hull, Sight]:
    beams, rays = sensor_beams(robot), robot.ray_table.rows[:, DIRECTION : DIRECTION + 3]
    rows = beam_rows(robot, robot.sensor_frames, beams, rays)
    radius = float(np.sqrt((robot.outline * robot.outline).sum(axis=1)).max())
    reaches, mass = (robot.height_m, radius, _measure_sight(rows)), 0.0
    fixed, movables = find_movables(world, tallest)
    if len(movables.bodies):
        mass = _weigh(robot)
        grid, *obstacles = obstacle_arrays(fixed, *reaches)
    else:
        grid, *obstacles = world_arrays(world, *reaches)
    steered = lay_out_steered_sight(robot, np.array([beam.clear_range for beam in beams]))
    sensors = rows, group_rows(robot, rows, rays), rays, steered
    return (
        Hull(radius, robot.height_m, mass, robot.outline, grid, *obstacles[:4]),
        Sight(*sensors, grid, *obstacles[4:]),
    )


def _weigh(robot: Robot) -> float:
    """Return the mass [kg] of a robot with its sensors."""
    masses = robot.urdf_elements().iterfind("link/inertial/mass")
    return sum(float(mass.get("value", "0")) for mass in masses)


def _measure_sight(beams: Array) -> float:
    """Return the reach of the sensors in half metres, so that designs share a world's arrays."""
    if not len(beams):
        return 0.5
    farthest = (np.sqrt((beams[:, :2] * beams[:, :2]).sum(axis=1)) + beams[:, FREE_RANGE]).max()
    return math.ceil(2.0 * float(farthest)) / 2
