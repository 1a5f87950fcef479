"""Measures how coarse the physics may be, and what each choice in setting up the engine saves.

Runs open-loop manoeuvres at each time step, number of solver iterations and shape of wheels, and
compares them with those at 2.5 ms and 50 iterations. Times a step with and without each choice.
Prints the tables and draws docs/img/engine.png:

    python benchmarks/fidelity/engine.py
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from engine_choices import CHOICES, costs
from engine_deviations import SECONDS, STEPS, TOLERANCE, Row, coarse, deviations, pushed
from engine_figure import figure

from evoros.config.compose import compose
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.robot.model import Robot


def show(rows: Sequence[Row], robot: Robot) -> None:
    curve = robot.drive.wheelbase_m / math.tan(0.3)
    exact = math.hypot(curve, robot.drive.rear_axle_x_m)  # of the origin of the base frame
    print(
        f"maximum deviation in {SECONDS:g} s [% of the distance]; radius by geometry {exact:.4f} m"
    )
    print("wheels    step [ms]  iterations  straight    turn   weave  radius [m]  speed [m/s]")
    for row in rows:
        straight, turn, weave = row.deviations
        good = "  within 2 %" if max(row.deviations) <= TOLERANCE else ""
        print(
            f"{row.wheels:<10}{1e3 * row.step:>9g}{row.iterations:>12}{straight:>10.2f}{turn:>8.2f}"
            f"{weave:>8.2f}{row.radius:>12.4f}{row.speed:>13.4f}{good}"
        )


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
    with_block = replace(ground, bodies=(*plane, block))
    rows = deviations(robots, replace(ground, bodies=plane))
    show(rows, robots["sphere"])
    print("\na 5 kg block that the rover drives against for 8 s, 20 iterations")
    for step in STEPS:
        far, deep = pushed(coarse(step, 20), robots["sphere"], with_block)
        print(f"{1e3 * step:6g} ms: moved by {far:6.1f} mm, sunk by {deep:5.1f} mm")
    spent = {name: costs(robots, world) for name, world in sphere.world.items()}
    print("\nprocessor time of a step [us]" + "".join(f"{name:>9}" for name in spent))
    for choice in CHOICES:
        print(f"{choice:<32}" + "".join(f"{times[choice]:>9.1f}" for times in spent.values()))
    figure(rows, spent)


if __name__ == "__main__":
    main()
