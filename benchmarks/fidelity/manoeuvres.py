"""Compares how all simulators drive the same commands on open ground.

The reference for manoeuvres and for the commands of missions is PyBullet at 2.5 ms and 50
iterations, and for turning circles it is geometry. Also measures whether the heading at the start
matters, which it does not in physics, and what PyBullet and the plane read at the same places.
Prints the tables of docs/fidelity.md and draws docs/img/manoeuvres.png:

    python benchmarks/fidelity/manoeuvres.py
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from engine_deviations import radius
from openloop import Manoeuvre, commands, distances, drive, length, open_ground
from shadow import Log, run_shadowed
from tracks import figure

from evoros.base.arrays import SPEED, STEERING, YAW, Array, X, Y
from evoros.base.rng import generator
from evoros.config.compose import compose
from evoros.evolution.experiment import Experiment
from evoros.plugins.gazebo.simulator import Gazebo
from evoros.simulator.mujoco import Mujoco
from evoros.simulator.planar import Planar
from evoros.simulator.protocol import Simulator
from evoros.simulator.pybullet import PyBullet

SECONDS = 20.0
FINE = PyBullet(time_step=0.0025, solver_iterations=50)
SIMULATORS: Mapping[str, Simulator] = {
    "PyBullet, 2.5 ms": FINE,
    "PyBullet, 25 ms": PyBullet(),
    "MuJoCo, 10 ms": Mujoco(),
    "Gazebo, 5 ms": Gazebo(),
    "planar": Planar(),
}
LOCK = 9.0  # [rad], more than any robot can steer, so that it steers to its limit
MANOEUVRES: Mapping[str, Manoeuvre] = {
    "straight on": lambda time: (0.29, 0.0),
    "turn, 0.3 rad": lambda time: (0.29, 0.3),
    "turn, full lock": lambda time: (0.3175, -LOCK),
    "step to 0.4 rad": lambda time: (0.29, 0.0 if time < 3.0 else 0.4),
    "weave": lambda time: (0.29, 0.6 * math.sin(2.0 * math.pi * time / 9.7)),
    "stop and go": lambda time: (0.29 if time % 4.0 < 2.0 else 0.0, 0.2),
    "lock to lock, 1 s": lambda time: (0.3175, LOCK if time % 2.0 < 1.0 else -LOCK),
    "lock to lock, 0.3 s": lambda time: (0.3175, LOCK if time % 0.6 < 0.3 else -LOCK),
}
SLALOM = "lock to lock, 1 s"
HEADINGS = np.radians(np.arange(0.0, 180.0, 7.5))
STEERINGS = (0.1, 0.2, 0.3, 0.5, LOCK)  # [rad]
LAGS = (0.0, 0.02, 0.03, 0.04, 0.05, 0.06, 0.08)  # [s]
PIECE = 100  # commands, or 10 s
PIECES = 5  # in each mission
SETTLED = 30  # control steps until the robot has dropped to the ground
AVOIDANCE_M = 2.0  # the controller avoids what it reads below this
AVERAGED = np.radians((11.0, 33.5, 56.0, 78.5))
"""Headings [rad] over which the reference is averaged; ``slaloms`` shows why."""
FIGURE = Path(__file__).parents[2] / "docs" / "img" / "manoeuvres.png"


def side_by_side(experiment: Experiment) -> dict[str, dict[str, Array]]:
    """Print the table of manoeuvres; returns the tracks by manoeuvre and simulator."""
    world = open_ground(experiment)
    print(f"\n## {SECONDS:g} s of the same commands, against {next(iter(SIMULATORS))}\n")
    others = list(SIMULATORS)[1:]
    print("| manoeuvre | distance [m] | " + " | ".join(f"{k} [mm] | [deg]" for k in others) + " |")
    print("|---" * (2 + 2 * len(others)) + "|")
    tracks: dict[str, dict[str, Array]] = {}
    for name, manoeuvre in MANOEUVRES.items():
        wanted = commands(manoeuvre, SECONDS)
        tracks[name] = {k: drive(s, experiment.robot, world, wanted) for k, s in SIMULATORS.items()}
        reference, *compared = tracks[name].values()
        cells = [
            f"{1e3 * distances(track, reference).max():.0f} | "
            f"{np.degrees(np.abs(track[:, YAW] - reference[:, YAW]).max()):.1f}"
            for track in compared
        ]
        print(f"| {name} | {length(reference):.2f} | {' | '.join(cells)} |")
    return tracks


def circles(experiment: Experiment) -> None:
    """Print turning circles against geometry; if they agree, nothing slips."""
    world, geometry = open_ground(experiment), experiment.robot.drive
    print("\n## Radius of the turning circle [m], and speed [m/s] at a command of 0.29 m/s\n")
    print("| steering [rad] | geometry | " + " | ".join(SIMULATORS) + " |")
    print("|---" * (len(SIMULATORS) + 2) + "|")
    for angle in STEERINGS:
        steering = min(angle, geometry.steering_limit)
        exact = math.hypot(geometry.wheelbase_m / math.tan(steering), geometry.rear_axle_x_m)
        cells = []
        for simulator in SIMULATORS.values():
            wanted = commands(lambda time, to=angle: (0.29, to), 60.0)  # type: ignore[misc]
            track = drive(simulator, experiment.robot, world, wanted)
            cells.append(f"{radius(track[:, [X, Y]]):.4f}, {track[-100:, SPEED].mean():.4f}")
        print(f"| {steering:.3g} | {exact:.4f} | {' | '.join(cells)} |")


def slaloms(experiment: Experiment) -> dict[str, Array]:
    """Print and return the turns (headings,) [deg] in 2 s of steering from lock to lock.

    Nothing in physics depends on which way the robot faces. A robot that turns equally far to both
    sides ends with the heading of its start. PyBullet's friction depends on the axes of the world.
    """
    world, wanted = open_ground(experiment), commands(MANOEUVRES[SLALOM], SECONDS)
    print(f"\n## {SLALOM}: turn [deg] in 2 s, over {len(HEADINGS)} headings at the start\n")
    print("| | minimum | mean | maximum | the same 90 deg further (to 0.001) | ends apart [m] |")
    print("|---|---|---|---|---|---|")
    finer = PyBullet(time_step=0.0025, solver_iterations=400)
    turns_by_simulator = {}
    for name, simulator in {**SIMULATORS, "PyBullet, 2.5 ms, 400 iterations": finer}.items():
        tracks = [drive(simulator, experiment.robot, world, wanted, h) for h in HEADINGS]
        turns = np.degrees([(track[200, YAW] - track[20, YAW]) / 9.0 for track in tracks])
        half = len(turns) // 2
        same = bool((np.abs(turns[:half] - turns[half:]) < 1e-3).all())
        ends = np.array([track[-1, [X, Y]] for track in tracks])
        spread = np.sqrt(((ends[:, None] - ends) ** 2).sum(axis=-1)).max()
        cells = f"{turns.min():+.3f} | {turns.mean():+.3f} | {turns.max():+.3f}"
        print(f"| {name} | {cells} | {'yes' if same else 'no'} | {spread:.2f} |")
        turns_by_simulator[name] = turns
    return turns_by_simulator


def run_missions(experiment: Experiment) -> list[tuple[str, Log]]:
    """Run missions of random designs in PyBullet; returns the world and the log of each."""
    rng = generator("0", "random_designs")
    designs = [experiment.space.decode(rng.random(experiment.space.size)) for _ in range(2)]
    return [
        (world, run_shadowed(experiment, design, world, f"0/evaluation/0/{world}/0"))
        for design in designs
        for world in experiment.world
    ]


def compare_readings(missions: list[tuple[str, Log]]) -> None:
    """Print what both read at the same places, while PyBullet's robot drives, pitches and rolls."""
    print("\n## Readings along missions in PyBullet, planar minus PyBullet\n")
    print("| world | readings | sd of roll, pitch [deg] | all: 50, 90, 99 % [mm] |", end="")
    print(" below 2 m: 50, 90, 99 % [mm] | mean | on different sides of 2 m |\n" + "|---" * 7 + "|")
    for world in dict(missions):
        logs = [log for name, log in missions if name == world]
        real, plane = (
            np.concatenate([np.array(rows)[SETTLED:] for rows in columns])
            for columns in zip(*((log.readings, log.shadows) for log in logs), strict=True)
        )
        tilt = np.concatenate([np.array(log.attitudes)[SETTLED:, 1:] for log in logs])
        differences, near = 1e3 * (plane - real), np.minimum(real, plane) < AVOIDANCE_M
        quantiles = [
            ", ".join(f"{q:.2f}" for q in np.quantile(np.abs(values), (0.5, 0.9, 0.99)))
            for values in (differences, differences[near])
        ]
        sides = int(((real < AVOIDANCE_M) != (plane < AVOIDANCE_M)).sum())
        roll, pitch = np.degrees(tilt.std(axis=0))
        print(
            f"| {world} | {real.size} | {roll:.3f}, {pitch:.3f} | {quantiles[0]} | {quantiles[1]} "
            f"| {differences[near].mean():+.2f} | {sides} |"
        )


def pieces(missions: list[tuple[str, Log]]) -> list[Array]:
    """Pieces of the commands of missions, each (PIECE, 2)."""
    tracks: list[Array] = []
    for _, log in missions:
        driven = np.array(log.commands)
        starts = np.linspace(SETTLED, len(driven) - PIECE, PIECES).astype(int)
        tracks += [driven[start : start + PIECE] for start in starts]
    return tracks


def compare_lags(experiment: Experiment, missions: list[tuple[str, Log]]) -> None:
    """Print which lag of the planar servos best fits the commands of missions, from rest."""
    robot, world = experiment.robot, open_ground(experiment)
    parts = pieces(missions)
    fine = [[drive(FINE, robot, world, part, h) for h in AVERAGED] for part in parts]
    mean = [np.mean(tracks, axis=0) for tracks in fine]
    print(f"\n## After 10 s of the commands of missions ({len(parts)} pieces)\n")
    print("| | median [mm] | rms [mm] | maximum [mm] | heading, rms [deg] | longer path [mm] |")
    print("|---|---|---|---|---|---|")
    single = [(track, m) for tracks, m in zip(fine, mean, strict=True) for track in tracks]
    _row("PyBullet, 2.5 ms, each heading", single)
    coarse = [
        (drive(PyBullet(), robot, world, part, h), reference)
        for part, reference in zip(parts, mean, strict=True)
        for h in AVERAGED
    ]
    _row("PyBullet, 25 ms, each heading", coarse)
    plane = Planar()
    variants = {f"planar, steering lag {1e3 * lag:g} ms": {"steering_lag_s": lag} for lag in LAGS}
    variants["planar, drive lag 15 ms"] = {"drive_lag_s": 0.015}
    variants["planar, steps of 5 ms"] = {"time_step": 0.005}
    for name, values in variants.items():
        simulator = replace(plane, **values)
        driven = [drive(simulator, robot, world, part) for part in parts]
        _row(name, list(zip(driven, mean, strict=True)))
    busy = [float(np.abs(np.diff(np.clip(g[:, STEERING], -0.7, 0.7))).sum()) / 10 for g in parts]
    print(f"\nsteering of the pieces: median {np.median(busy):.2f}, maximum {max(busy):.2f} rad/s")


def _row(name: str, pairs: list[tuple[Array, Array]]) -> None:
    far = np.array([1e3 * distances(track, reference)[-1] for track, reference in pairs])
    turned = np.array([np.degrees(a[-1, YAW] - b[-1, YAW]) for a, b in pairs])
    longer = np.mean([1e3 * (length(a) - length(b)) for a, b in pairs])
    spread = [math.sqrt(float((errors * errors).mean())) for errors in (far, turned)]
    print(
        f"| {name} | {np.median(far):.1f} | {spread[0]:.1f} | {far.max():.1f} | {spread[1]:.2f} | "
        f"{longer:+.1f} |"
    )


def main() -> None:
    experiment = compose([]).build()
    tracks = side_by_side(experiment)
    circles(experiment)
    turns = slaloms(experiment)
    missions = run_missions(experiment)
    compare_readings(missions)
    compare_lags(experiment, missions)
    figure(tracks, np.degrees(HEADINGS), turns, FIGURE)


if __name__ == "__main__":
    main()
