"""A robot with any sensors in any simulator, and what they read while it drives."""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from evoros.base.arrays import STATE_SIZE, Array
from evoros.base.rng import generator
from evoros.failure.protocol import Fault, number_faults
from evoros.mission.inputs import FilterStage
from evoros.mission.participant import Draws
from evoros.mission.pipeline import list_sensor_targets, start_faults, start_sensors
from evoros.robot.model import Robot
from evoros.sensor.protocol import Mount, Sensor
from evoros.simulator.protocol import Simulator, open_alone
from evoros.world.model import World

TICK_S = 0.1
Decide = Callable[[int, Array, Array], tuple[float, float]]
"""The speed [m/s] and the steering angle [rad] in a tick, by its number, state and readings."""


def equip(robot: Robot, *mounts: tuple[str, float, float, float, float], **types: Sensor) -> Robot:
    """The robot with sensors at x, y [m], yaw, pitch [deg], 0.2 m above the ground."""
    placed = [Mount(kind, "base_link", x, y, 0.2, yaw, pitch) for kind, x, y, yaw, pitch in mounts]
    return robot.with_sensors(placed, types)


def start_chain(
    robot: Robot, faults: Sequence[Fault], signals: Array, readings: Array, draws: Draws
) -> list[FilterStage]:
    """All stages between the signals and the readings of a robot's sensors, as in a mission."""
    targets = list_sensor_targets(robot, readings, TICK_S)
    stages = start_sensors(robot, targets, signals, draws)
    for target in targets:
        stages += start_faults(number_faults(faults), target, draws, {})
    return stages


def record(
    simulator: Simulator, robot: Robot, world: World, commands: Sequence[tuple[float, float, float]]
) -> tuple[Array, Array]:
    """Drive (speed [m/s], steering [rad], time [s]), one after another; see ``react``."""
    wanted = [(v, a) for v, a, time in commands for _ in range(round(time / TICK_S))]
    plan = [*wanted, (0.0, 0.0)]
    return react(simulator, robot, world, lambda tick, *_: plan[tick], len(plan))


def react(
    simulator: Simulator, robot: Robot, world: World, decide: Decide, ticks: int
) -> tuple[Array, Array]:
    """Drive as ``decide`` answers to the number of the tick, the state and the readings.

    Return the readings (ticks, channels) and the states (ticks, STATE_SIZE); the first are those at
    the start.
    """
    signals, readings = np.zeros(robot.signal_count), np.zeros(robot.channel_count)
    draws = partial(generator, "test")
    stages = start_chain(robot, (), signals, readings, draws)
    rows, states = [], []
    with open_alone(simulator.open, robot, world) as simulation:
        for tick in range(ticks):
            state = np.zeros(STATE_SIZE)
            simulation.observe(state)
            simulation.sense(signals)
            for stage in stages:
                if tick % stage.every == 0:
                    stage.rule(*stage[2:7], tick * TICK_S)
            rows.append(readings.copy())
            states.append(state)
            simulation.advance(np.array(decide(tick, state, readings)), TICK_S)
    return np.array(rows), np.array(states)
