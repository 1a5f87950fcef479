"""The same commands in both simulators on open ground: how far apart do they drive, and why?

Given manoeuvres and the commands of missions, against PyBullet at 2.5 ms and 50 iterations; turning
circles against geometry; whether it matters which way the robot faces at first, as in physics it
does not; what both read in the same places. Prints tables of docs/fidelity.md and draws
docs/img/manoeuvres.png:

    python benchmarks/fidelity/manoeuvres.py
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from engine import radius
from openloop import Manoeuvre, apart, commands, drive, open_ground, way
from shadow import Log, shadowed
from tracks import figure

from evoros.base.arrays import SPEED, STEERING, YAW, Array, X, Y
from evoros.base.rng import generator
from evoros.config.compose import compose
from evoros.evolution.experiment import Experiment
from evoros.simulator.planar import Planar
from evoros.simulator.protocol import Simulator
from evoros.simulator.pybullet import PyBullet

SECONDS = 20.0
FINE = PyBullet(time_step=0.0025, solver_iterations=50)
SIMULATORS: Mapping[str, Simulator] = {
    "PyBullet, 2.5 ms": FINE,
    "PyBullet, 25 ms": PyBullet(),
    "planar": Planar(),
}
LOCK = 9.0  # [rad]: more than any robot steers, so that it steers as far as it can
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
ANGLES = (0.1, 0.2, 0.3, 0.5, LOCK)  # of steering [rad]
LAGS = (0.0, 0.02, 0.03, 0.04, 0.05, 0.06, 0.08)  # [s]
PIECE = 100  # commands: 10 s
PIECES = 5  # of each mission
SETTLED = 30  # control steps, after which the robot has come down from where it is set
VOTED = 2.0  # [m]: below, a reading has a vote
AVERAGED = np.radians((11.0, 33.5, 56.0, 78.5))
"""Headings over whose tracks the reference is averaged: see ``slaloms``."""
FIGURE = Path(__file__).parents[2] / "docs" / "img" / "manoeuvres.png"


def side_by_side(experiment: Experiment) -> dict[str, dict[str, Array]]:
    """Tracks by manoeuvre and simulator."""
    world = open_ground(experiment)
    print(f"\n## {SECONDS:g} s of the same commands, against {next(iter(SIMULATORS))}\n")
    print("| manoeuvre | way [m] | PyBullet, 25 ms [mm] | [deg] | planar [mm] | [deg] |")
    print("|---|---|---|---|---|---|")
    tracks = {}
    for name, manoeuvre in MANOEUVRES.items():
        wanted = commands(manoeuvre, SECONDS)
        each = {k: drive(s, experiment.robot, world, wanted) for k, s in SIMULATORS.items()}
        reference, *others = each.values()
        cells = [
            f"{1e3 * apart(track, reference).max():.0f} | "
            f"{np.degrees(np.abs(track[:, YAW] - reference[:, YAW]).max()):.1f}"
            for track in others
        ]
        print(f"| {name} | {way(reference):.2f} | {' | '.join(cells)} |")
        tracks[name] = each
    return tracks


def circles(experiment: Experiment) -> None:
    """Turning circles against geometry: nothing slips where they agree."""
    world, drive_ = open_ground(experiment), experiment.robot.drive
    print("\n## Radius of the turning circle [m], and speed [m/s] where 0.29 is asked for\n")
    print("| steering [rad] | geometry | " + " | ".join(SIMULATORS) + " |")
    print("|---" * (len(SIMULATORS) + 2) + "|")
    for angle in ANGLES:
        steering = min(angle, drive_.steering_limit)
        exact = math.hypot(drive_.wheelbase_m / math.tan(steering), drive_.rear_axle_x_m)
        cells = []
        for simulator in SIMULATORS.values():
            wanted = commands(lambda time, to=angle: (0.29, to), 60.0)  # type: ignore[misc]
            track = drive(simulator, experiment.robot, world, wanted)
            cells.append(f"{radius(track[:, [X, Y]]):.4f}, {track[-100:, SPEED].mean():.4f}")
        print(f"| {steering:.3g} | {exact:.4f} | {' | '.join(cells)} |")


def slaloms(experiment: Experiment) -> dict[str, Array]:
    """(headings,) the turn [deg] in two seconds of steering from lock to lock.

    Nothing in physics depends on which way the robot faces, and what turns as far to the left as
    to the right ends where it faced. PyBullet's friction knows the axes of the world.
    """
    world, wanted = open_ground(experiment), commands(MANOEUVRES[SLALOM], SECONDS)
    print(f"\n## {SLALOM}: turn [deg] in 2 s, over {len(HEADINGS)} headings at the start\n")
    print("| | least | mean | greatest | the same to 0.001 deg 90 deg further | ends apart [m] |")
    print("|---|---|---|---|---|---|")
    more = PyBullet(time_step=0.0025, solver_iterations=400)
    found = {}
    for name, simulator in {**SIMULATORS, "PyBullet, 2.5 ms, 400 iterations": more}.items():
        tracks = [drive(simulator, experiment.robot, world, wanted, h) for h in HEADINGS]
        turns = np.degrees([(track[200, YAW] - track[20, YAW]) / 9.0 for track in tracks])
        half = len(turns) // 2
        same = bool((np.abs(turns[:half] - turns[half:]) < 1e-3).all())
        ends = np.array([track[-1, [X, Y]] for track in tracks])
        parted = np.sqrt(((ends[:, None] - ends) ** 2).sum(axis=-1)).max()
        cells = f"{turns.min():+.3f} | {turns.mean():+.3f} | {turns.max():+.3f}"
        print(f"| {name} | {cells} | {'yes' if same else 'no'} | {parted:.2f} |")
        found[name] = turns
    return found


def flown(experiment: Experiment) -> list[tuple[str, Log]]:
    """Missions of random designs in PyBullet, by world."""
    rng = generator("0", "random_designs")
    designs = [experiment.space.decode(rng.random(experiment.space.size)) for _ in range(2)]
    return [
        (world, shadowed(experiment, design, world, f"0/evaluation/0/{world}/0"))
        for design in designs
        for world in experiment.world
    ]


def senses(missions: list[tuple[str, Log]]) -> None:
    """What both read in the same places while the robot of PyBullet drives, pitches and rolls."""
    print("\n## Readings along missions in PyBullet, planar less PyBullet\n")
    print("| world | readings | sd of roll, pitch [deg] | all: 50, 90, 99 % [mm] |", end="")
    print(" below 2 m: 50, 90, 99 % [mm] | mean | on different sides of 2 m |\n" + "|---" * 7 + "|")
    for world in dict(missions):
        logs = [log for name, log in missions if name == world]
        real, plane = (
            np.concatenate([np.array(rows)[SETTLED:] for rows in each])
            for each in zip(*((log.readings, log.shadows) for log in logs), strict=True)
        )
        tilt = np.concatenate([np.array(log.attitudes)[SETTLED:, 1:] for log in logs])
        apart_, near = 1e3 * (plane - real), np.minimum(real, plane) < VOTED
        quantiles = [
            ", ".join(f"{q:.2f}" for q in np.quantile(np.abs(each), (0.5, 0.9, 0.99)))
            for each in (apart_, apart_[near])
        ]
        sides = int(((real < VOTED) != (plane < VOTED)).sum())
        roll, pitch = np.degrees(tilt.std(axis=0))
        print(
            f"| {world} | {real.size} | {roll:.3f}, {pitch:.3f} | {quantiles[0]} | {quantiles[1]} "
            f"| {apart_[near].mean():+.2f} | {sides} |"
        )


def pieces(missions: list[tuple[str, Log]]) -> list[Array]:
    """Commands (PIECE, 2) from missions."""
    found: list[Array] = []
    for _, log in missions:
        given = np.array(log.commands)
        starts = np.linspace(SETTLED, len(given) - PIECE, PIECES).astype(int)
        found += [given[start : start + PIECE] for start in starts]
    return found


def replayed(experiment: Experiment, missions: list[tuple[str, Log]]) -> None:
    """Commands of missions, from rest: which lag of the planar servos fits best?"""
    robot, world = experiment.robot, open_ground(experiment)
    given = pieces(missions)
    fine = [[drive(FINE, robot, world, each, h) for h in AVERAGED] for each in given]
    mean = [np.mean(tracks, axis=0) for tracks in fine]
    print(f"\n## After 10 s of the commands of missions ({len(given)} pieces)\n")
    print("| | median [mm] | rms [mm] | greatest [mm] | rms [deg] | mean way [mm] |")
    print("|---|---|---|---|---|---|")
    itself = [(track, each) for tracks, each in zip(fine, mean, strict=True) for track in tracks]
    _row("PyBullet, 2.5 ms, each heading", itself)
    coarse = [
        (drive(PyBullet(), robot, world, each, h), reference)
        for each, reference in zip(given, mean, strict=True)
        for h in AVERAGED
    ]
    _row("PyBullet, 25 ms, each heading", coarse)
    plane = Planar()
    variants = {f"planar, steering lag {1e3 * lag:g} ms": {"steering_lag_s": lag} for lag in LAGS}
    variants["planar, drive lag 15 ms"] = {"drive_lag_s": 0.015}
    variants["planar, steps of 5 ms"] = {"time_step": 0.005}
    for name, values in variants.items():
        simulator = replace(plane, **values)
        driven = [drive(simulator, robot, world, each) for each in given]
        _row(name, list(zip(driven, mean, strict=True)))
    busy = [float(np.abs(np.diff(np.clip(g[:, STEERING], -0.7, 0.7))).sum()) / 10 for g in given]
    print(f"\nsteering of the pieces: median {np.median(busy):.2f}, most {max(busy):.2f} rad/s")


def _row(name: str, pairs: list[tuple[Array, Array]]) -> None:
    far = np.array([1e3 * apart(track, reference)[-1] for track, reference in pairs])
    turned = np.array([np.degrees(a[-1, YAW] - b[-1, YAW]) for a, b in pairs])
    longer = np.mean([1e3 * (way(a) - way(b)) for a, b in pairs])
    spread = [math.sqrt(float((each * each).mean())) for each in (far, turned)]
    print(
        f"| {name} | {np.median(far):.1f} | {spread[0]:.1f} | {far.max():.1f} | {spread[1]:.2f} | "
        f"{longer:+.1f} |"
    )


def main() -> None:
    experiment = compose([]).build()
    tracks = side_by_side(experiment)
    circles(experiment)
    turns = slaloms(experiment)
    missions = flown(experiment)
    senses(missions)
    replayed(experiment, missions)
    figure(tracks, np.degrees(HEADINGS), turns, FIGURE)


if __name__ == "__main__":
    main()
