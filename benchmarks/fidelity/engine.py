"""How coarse the physics may be, and what each choice in setting up the engine gains.

Open-loop manoeuvres at each time step, number of solver iterations and shape of wheels, against
the same at 2.5 ms and 50 iterations; the cost of a step with and without each choice. Prints the
tables and draws docs/img/engine.png:  python benchmarks/fidelity/engine.py
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import thread_time
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import openloop
from lxml import etree
from openloop import commands

from evoros.base.arrays import SPEED, Array, X, Y
from evoros.config.compose import compose
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.robot.model import Robot
from evoros.simulator.engines import pybullet_bodies, pybullet_model, pybullet_robot
from evoros.simulator.engines.pybullet_simulation import PyBulletSimulation
from evoros.simulator.protocol import Simulator
from evoros.simulator.pybullet import PyBullet, import_pybullet
from evoros.world.model import World

STEPS = (0.0025, 0.005, 0.01, 0.02, 0.025, 0.05)  # [s]
ITERATIONS = (50, 20, 10, 4)
WHEELS = ("sphere", "cylinder")
SPEED_MPS, SECONDS = 0.29, 20.0
TOLERANCE = 2.0  # [%]
MANOEUVRES: dict[str, Callable[[float], float]] = {
    "straight": lambda time: 0.0,
    "turn": lambda time: 0.3,
    "weave": lambda time: 0.3 * math.sin(2.0 * math.pi * time / 9.7),
}
FIGURE = Path(__file__).parents[2] / "docs" / "img" / "engine.png"


def drive(simulator: Simulator, robot: Robot, world: World, name: str) -> Array:
    """(n, 3): x, y [m] and speed [m/s] every 0.1 s, from the robot's being set down."""
    wanted = commands(lambda time: (SPEED_MPS, MANOEUVRES[name](time)), SECONDS)
    track = openloop.drive(simulator, robot, world, wanted, world.course.home[3])
    return track[1:, [X, Y, SPEED]]


def deviation(track: Array, reference: Array) -> float:
    """The greatest distance from the reference at the same time, in % of its length."""
    length = np.linalg.norm(np.diff(reference[:, :2], axis=0), axis=1).sum()
    gaps = np.linalg.norm(track[:, :2] - reference[:, :2], axis=1)
    return float(100.0 * gaps.max() / length)


def radius(track: Array) -> float:
    """Of the circle [m] that fits the second half of a track best (Kasa's method)."""
    x, y = track[len(track) // 2 :, :2].T
    terms = np.stack([x, y, np.ones_like(x)], axis=1)
    (a, b, c), *_ = np.linalg.lstsq(terms, x * x + y * y, rcond=None)
    return math.sqrt(float(c + a * a / 4 + b * b / 4))


@dataclass(frozen=True)
class Row:
    """One set-up: its deviations [%], the turn's radius [m] and the straight speed [m/s]."""

    wheels: str
    step: float
    iterations: int
    deviations: tuple[float, ...]
    radius: float
    speed: float


def fidelity(robots: dict[str, Robot], world: World) -> list[Row]:
    """All combinations against the finest with the same wheels."""
    rows = []
    for wheels, robot in robots.items():
        finest = {name: drive(PyBullet(0.0025, 50), robot, world, name) for name in MANOEUVRES}
        for step in STEPS:
            for iterations in ITERATIONS:
                simulator = coarse(step, iterations)
                tracks = {name: drive(simulator, robot, world, name) for name in MANOEUVRES}
                off = tuple(deviation(tracks[name], finest[name]) for name in MANOEUVRES)
                speed = float(tracks["straight"][-100:, 2].mean())
                rows.append(Row(wheels, step, iterations, off, radius(tracks["turn"]), speed))
    return rows


def show(rows: Sequence[Row], robot: Robot) -> None:
    drive_ = robot.drive
    curve = drive_.wheelbase_m / math.tan(0.3)
    exact = math.hypot(curve, drive_.rear_axle_x_m)  # that of the base frame's origin
    print(f"greatest deviation in {SECONDS:g} s [% of the way]; radius by geometry {exact:.4f} m")
    print("wheels    step [ms]  iterations  straight    turn   weave  radius [m]  speed [m/s]")
    for row in rows:
        straight, turn, weave = row.deviations
        good = "  within 2 %" if max(row.deviations) <= TOLERANCE else ""
        print(
            f"{row.wheels:<10}{1e3 * row.step:>9g}{row.iterations:>12}{straight:>10.2f}{turn:>8.2f}"
            f"{weave:>8.2f}{row.radius:>12.4f}{row.speed:>13.4f}{good}"
        )


def coarse(step: float, iterations: int) -> PyBullet:
    """Also with steps that the simulator refuses, to show why."""
    simulator = PyBullet(solver_iterations=iterations)
    object.__setattr__(simulator, "time_step", step)
    return simulator


def pushed(simulator: PyBullet, robot: Robot, world: World) -> tuple[float, float]:
    """How far [mm] the rover pushes a 5 kg block in 8 s, and how deep it sinks then."""
    with simulator.open(robot, world) as opened:
        simulation: Any = opened
        bullet, client = simulation._bullet, simulation._client
        (block, (before, _)) = next(iter(simulation._model.movable.items()))
        simulation.advance(np.array([0.3, 0.0]), 8.0)
        after, _ = bullet.getBasePositionAndOrientation(block, client)
    return 1e3 * math.dist(after[:2], before[:2]), 1e3 * (before[2] - after[2])


class Without:
    """The engine's module without one of the choices in how bodies are built."""

    def __init__(self, bullet: Any, choice: str) -> None:
        self._bullet, self._choice = bullet, choice

    def __getattr__(self, name: str) -> Any:
        return getattr(self._bullet, name)

    def createMultiBody(self, *args: Any, **named: Any) -> Any:  # noqa: N802
        """As the engine's, in its usual coordinates if so chosen."""
        if self._choice == "reduced":
            named["useMaximalCoordinates"] = False
        return self._bullet.createMultiBody(*args, **named)

    def changeDynamics(self, *args: Any, **named: Any) -> Any:  # noqa: N802
        """As the engine's, but nothing sleeps if so chosen."""
        if self._choice == "awake" and "activationState" in named:
            return None
        return self._bullet.changeDynamics(*args, **named)

    def setCollisionFilterGroupMask(self, *args: Any, **named: Any) -> None:  # noqa: N802
        """As the engine's, but everything meets everything if so chosen."""
        body, link, group, meets = args
        if self._choice == "pairs" and group in (pybullet_bodies.FIXED, pybullet_bodies.GROUND):
            meets = 0xFFFF
        self._bullet.setCollisionFilterGroupMask(body, link, group, meets, **named)


CHOICES = {
    "as it is": "",
    "sensors as links of their own": "links",
    "pairs of fixed bodies looked at": "pairs",
    "world in reduced coordinates": "reduced",
    "movable bodies awake": "awake",
    "wheels as cylinders": "cylinder",
    "50 solver iterations": "50",
    "10 solver iterations": "10",
}


def running(choice: str, robots: dict[str, Robot], world: World) -> tuple[Any, Any]:
    """An engine that drives a curve at home, and its client."""
    engine = pybullet_model.Engine(Without(import_pybullet(), choice))
    settings = pybullet_model.Settings(0.025, int(choice) if choice.isdigit() else 20, 1.0, 0.05)
    robot = robots["cylinder" if choice == "cylinder" else "sphere"]
    merge = vars(pybullet_robot)["merge_fixed_links"]
    if choice == "links":
        vars(pybullet_robot)["merge_fixed_links"] = lambda root, kept: etree.tostring(root).decode()
    try:
        model = engine.prepare(robot, world, settings)
    finally:
        vars(pybullet_robot)["merge_fixed_links"] = merge
    simulation = PyBulletSimulation(engine.bullet, engine.client, model, robot, settings)
    simulation.advance(np.array([0.1, 0.6]), 2.0)
    return engine, import_pybullet().stepSimulation


def costs(robots: dict[str, Robot], world: World) -> dict[str, float]:
    """Microseconds of a step for each choice: all run in turn, so that a busy machine slows all."""
    engines = {name: running(choice, robots, world) for name, choice in CHOICES.items()}
    spent: dict[str, list[float]] = {name: [] for name in CHOICES}
    for _ in range(80):
        for name, (engine, step) in engines.items():
            begin = thread_time()
            for _ in range(10):
                step(engine.client)
            spent[name].append((thread_time() - begin) / 10)
    for engine, _ in engines.values():
        engine.close()
    return {name: 1e6 * float(np.percentile(each, 20)) for name, each in spent.items()}


def figure(rows: Sequence[Row], spent: dict[str, dict[str, float]]) -> None:
    plt.rcParams.update({"font.size": 9, "axes.spines.top": False, "axes.spines.right": False})
    canvas, (left, right) = plt.subplots(1, 2, figsize=(7.2, 3.8), layout="constrained")
    colours = ("#0072b2", "#e69f00", "#009e73", "#cc79a7")
    for wheels, line in zip(WHEELS, ("-", ":"), strict=True):
        for iterations, colour in zip(ITERATIONS, colours, strict=True):
            found = [r for r in rows if (r.wheels, r.iterations) == (wheels, iterations)]
            left.plot(
                [1e3 * row.step for row in found],
                [max(0.01, *row.deviations) for row in found],
                line,
                color=colour,
                marker="o",
                markersize=3,
                linewidth=1.2,
                label=f"{iterations} iterations, {wheels}s",
            )
    left.axhline(TOLERANCE, color="0.5", linewidth=0.8)
    left.text(2.3, 0.92 * TOLERANCE, "2 %", color="0.4", va="top", fontsize=8)
    left.set_xscale("log")
    left.set_yscale("log")
    left.set_xticks([1e3 * step for step in STEPS], ["2.5", "5", "10", "20", "\n25", "50"])
    left.minorticks_off()
    left.set_xlabel("time step [ms]")
    left.set_ylabel("greatest deviation [% of the way]")
    lines = left.get_legend_handles_labels()
    canvas.legend(*lines, ncols=4, fontsize=7, loc="outside lower center", frameon=False)
    names = list(CHOICES)[::-1]
    for shift, (world, each) in enumerate(spent.items()):
        places = np.arange(len(names)) + 0.26 * (1 - shift)
        right.barh(places, [each[n] for n in names], 0.24, color=colours[shift], label=world)
    right.set_yticks(range(len(names)), names, fontsize=8)
    right.set_xlabel("processor time of a step [us]")
    right.legend(frameon=False, fontsize=7, loc="upper right")
    FIGURE.parent.mkdir(parents=True, exist_ok=True)
    canvas.savefig(FIGURE, dpi=300)


def main() -> None:
    sphere = compose([]).build()
    cylinder = compose(["+robot.arguments.wheel_collision=cylinder"]).build()
    design = sphere.space.decode(np.full(sphere.space.size, 0.5))
    bare = {"sphere": sphere.robot, "cylinder": cylinder.robot}
    robots = {
        name: r.with_sensors(design.mounts, sphere.design.sensors) for name, r in bare.items()
    }
    ground, *_ = sphere.world.values()
    block = Body(
        "block", Pose((0.0, 1.0, 0.0715)), (Shape("box", (0.397, 0.194, 0.143)),), mass=5.0
    )
    plane = tuple(body for body in ground.bodies if body.is_ground)
    rows = fidelity(robots, replace(ground, bodies=plane))
    show(rows, robots["sphere"])
    print("\na 5 kg block that the rover drives against for 8 s, 20 iterations")
    for step in STEPS:
        far, deep = pushed(
            coarse(step, 20), robots["sphere"], replace(ground, bodies=(*plane, block))
        )
        print(f"{1e3 * step:6g} ms: moved by {far:6.1f} mm, sunk by {deep:5.1f} mm")
    spent = {name: costs(robots, world) for name, world in sphere.world.items()}
    print("\nprocessor time of a step [us]" + "".join(f"{name:>9}" for name in spent))
    for choice in CHOICES:
        print(f"{choice:<32}" + "".join(f"{each[choice]:>9.1f}" for each in spent.values()))
    figure(rows, spent)


if __name__ == "__main__":
    main()
