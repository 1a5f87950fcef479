"""Calculates how the original rover must have turned in Gazebo, and about which point.

A small rigid-body model of the rover as its description states it, moved as its plugin moved it
(erlerobot/ardupilot_sitl_gazebo_plugin at ea596b3): 800 kg and four wheels of 20 kg with an inertia
of 1 kg m2 about their axles; friction 10 behind and 1 in front; at each step of 2.5 ms the plugin
sets both front wheels to one angle and the rates of all four wheels to one value. Prints the radius
of the circle and the turning point, of which docs/original.md tells:

    python benchmarks/original/turning.py

The contacts follow the Open Dynamics Engine: each wheel has a normal force and two friction
forces, limited separately by the coefficient times the normal force (its pyramid, dContactApprox1),
solved together by projected Gauss-Seidel with over-relaxation. Stiffness k gives the normal
constraint ERP = h k / (h k + d) and CFM = 1 / (h k + d), with damping d = 1 N s/m. The first
friction direction is `fdir1`, 1 0 0 in the frame of the wheel, with which it turns, and the second
is the normal times the first. Joints are exact, unlike the engine's.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numba import njit

from evoros.base.arrays import Array

CHASSIS_KG, WHEEL_KG, BLOCK_KG = 800.0, 20.0, 1.0
CHASSIS_X_M, HEIGHT_M, RADIUS_M = 0.02, 0.08, 0.0635
WHEELS = np.array([[0.24, 0.143], [0.24, -0.143], [-0.15, 0.15], [-0.15, -0.15]])  # x, y [m]
MASS_KG = CHASSIS_KG + 4 * WHEEL_KG + 2 * BLOCK_KG
CENTRE_X_M = float(
    CHASSIS_KG * CHASSIS_X_M + WHEEL_KG * WHEELS[:, 0].sum() + 2 * BLOCK_KG * WHEELS[0, 0]
) / (MASS_KG)
OFF_AXIS_KGM2 = 0.5  # of a wheel
STEP_S, GRAVITY, DAMPING = 0.0025, 9.81, 1.0
ITERATIONS, RELAXATION = 50, 1.3
SPEED_MPS, SECONDS, SETTLING_S = 0.29, 16.0, 4.0
WEAVE_S, WEAVE_DEG = 4.0, 25.0


@dataclass(frozen=True)
class Rover:
    """The properties that the table varies; pairs have the front first, then the rear."""

    friction: tuple[float, float] = (1.0, 10.0)
    stiffness: tuple[float, float] = (1e7, 1e6)  # [N/m]
    rotating: bool = True  # the friction directions turn with the wheels
    wheel_kgm2: float = 1.0  # of a wheel about its axle
    yaw_kgm2: float = 550.0  # of the chassis


@njit  # type: ignore[untyped-decorator]
def wheel_rows(steering: float, turned: float, place: Array, number: int, rows: Array) -> None:
    """Fill the Jacobian rows (3, 10) of a wheel: normal force and two friction forces.

    The velocities (10,) are the centre of mass's, the rates of the chassis (both in axes
    that yaw with it) and the rates of the wheels. ``turned`` [rad] is the angle of the wheel.
    """
    cos, sin = math.cos(steering), math.sin(steering)
    axle = np.array([-sin, cos, 0.0])
    up = np.array([0.0, 0.0, 1.0])
    first = np.array([math.cos(turned) * cos, math.cos(turned) * sin, -math.sin(turned)])
    second = math.cos(turned) * axle  # the normal times the first
    down = np.array([0.0, 0.0, -RADIUS_M])
    rows[:] = 0.0
    for row, direction in enumerate((up, first, second)):
        arm = np.cross(down, direction)
        along = np.dot(arm, axle)  # the wheel has its own rate about its axle
        rows[row, :3] = direction
        rows[row, 3:6] = np.cross(place, direction) + arm - along * axle
        rows[row, 6 + number] = along


@njit  # type: ignore[untyped-decorator]
def solve(
    rows: Array, wanted: Array, soft: Array, inverse: Array, friction: Array, u: Array
) -> None:
    """Change the velocities ``u`` (10,) by the contact forces of one step."""
    forces = np.zeros(12)
    shares = soft + STEP_S * (rows * rows * inverse).sum(axis=1)
    for _ in range(ITERATIONS):
        for i in range(12):
            if shares[i] < 1e-12:
                continue
            error = wanted[i] - np.dot(rows[i], u) - soft[i] * forces[i]
            force = forces[i] + RELAXATION * error / shares[i]
            if i % 3 == 0:
                force = max(force, 0.0)
            else:
                limit = friction[i // 3] * forces[i - i % 3]
                force = min(max(force, -limit), limit)
            u += STEP_S * (force - forces[i]) * inverse * rows[i]
            forces[i] = force


@njit  # type: ignore[untyped-decorator]
def turn_axes(pairs: Array, angle: float) -> None:
    """Express the x and y of each row in axes that have turned by an angle [rad]."""
    cos, sin = math.cos(angle), math.sin(angle)
    for pair in pairs:
        x, y = pair[0], pair[1]
        pair[0], pair[1] = cos * x + sin * y, cos * y - sin * x


@njit  # type: ignore[untyped-decorator]
def simulate(
    steering: Array, rate: float, inverse: Array, friction: Array, stiffness: Array, rotating: bool
) -> Array:
    """Drive with the steering angles of the steps [rad].

    Returns the velocity of the centre of mass ahead and to the left, and the yaw rate, (steps, 3).
    """
    motion = np.zeros((len(steering), 3))
    u, rows = np.zeros(10), np.zeros((12, 10))
    wanted, soft = np.zeros(12), np.zeros(12)
    lift, tilt, turned = 0.0, np.zeros((1, 2)), np.zeros(4)  # [m]; roll and pitch [rad]; [rad]
    for k, angle in enumerate(steering):
        for i in range(4):
            front = angle if i < 2 else 0.0
            u[6 + i] = rate - u[3] * math.sin(front) + u[4] * math.cos(front)
            place = np.array([WHEELS[i, 0] - CENTRE_X_M, WHEELS[i, 1], RADIUS_M - HEIGHT_M])
            wheel = rows[3 * i : 3 * i + 3]
            wheel_rows(front, turned[i] if rotating else 0.0, place, i, wheel)
            depth = -(lift + tilt[0, 0] * place[1] - tilt[0, 1] * place[0])
            firm = STEP_S * stiffness[i]
            wanted[3 * i] = firm / (firm + DAMPING) * depth / STEP_S
            soft[3 * i] = 1.0 / (firm + DAMPING)
            if depth < 0.0:
                wheel[:] = 0.0
        u[2] -= STEP_S * GRAVITY
        solve(rows, wanted, soft, inverse, friction, u)
        lift += STEP_S * u[2]
        tilt[0] += STEP_S * u[3:5]
        turned += STEP_S * u[6:]
        motion[k] = u[0], u[1], u[5]
        velocities = np.stack((u[:2], u[3:5]))
        turn_axes(velocities, STEP_S * u[5])
        turn_axes(tilt, STEP_S * u[5])
        u[:2], u[3:5] = velocities[0], velocities[1]
    return motion


def drive(rover: Rover, steering: Array) -> tuple[float, float]:
    """Return the mean radius [m] and the turning point's x [m], once the motion has settled.

    The turning point is where the velocity to the left is least, by least squares.
    """
    offsets = WHEELS - [CENTRE_X_M, 0.0]
    yaw = rover.yaw_kgm2 + 4 * OFF_AXIS_KGM2 + 2 * BLOCK_KG + WHEEL_KG * (offsets**2).sum()
    inertias = [MASS_KG] * 3 + [145.0, 552.0, yaw] + [rover.wheel_kgm2] * 4
    pairs = [np.repeat(pair, 2) for pair in (rover.friction, rover.stiffness)]
    rate = SPEED_MPS / RADIUS_M
    motion = simulate(steering, rate, 1.0 / np.array(inertias), *pairs, rover.rotating)
    ahead, left, yaw_rate = motion[round(SETTLING_S / STEP_S) :].T
    point = CENTRE_X_M - float((left * yaw_rate).sum() / (yaw_rate**2).sum())
    return float(np.abs(ahead).mean() / max(np.abs(yaw_rate).mean(), 1e-6)), point


def main() -> None:
    times = np.arange(round(SECONDS / STEP_S)) * STEP_S
    weave = np.radians(WEAVE_DEG) * np.sign(np.sin(2.0 * np.pi * times / WEAVE_S))
    rover = Rover()
    rovers = {
        "as built": rover,
        "friction directions do not turn": replace(rover, rotating=False),
        "and wheels that keep their rates": replace(rover, rotating=False, wheel_kgm2=1e4),
        "friction 1 behind, too": replace(rover, friction=(1.0, 1.0)),
        "friction 0.3 behind": replace(rover, friction=(1.0, 0.3)),
        "yaw inertia 50 kg m2": replace(rover, yaw_kgm2=50.0),
    }
    angles = (10.0, 25.0, math.degrees(0.7727))
    heads = [f"{angle:.0f} deg" for angle in angles]
    print(
        "| radius, turning point x [m] | " + " | ".join(heads) + " | weave |\n" + "|---" * 5 + "|"
    )
    geometry = [f"{0.39 / math.tan(math.radians(angle)):.2f}, -0.15" for angle in angles]
    print("| geometry | " + " | ".join(geometry) + " | -0.15 |")
    for name, one in rovers.items():
        cells = []
        for angle in angles:
            radius, point = drive(one, np.full(len(times), math.radians(angle)))
            cells.append(f"{radius:.2f}, {point:+.2f}" if radius < 20.0 else "hardly turns")
        print(f"| {name} | " + " | ".join(cells) + f" | {drive(one, weave)[1]:+.2f} |", flush=True)


if __name__ == "__main__":
    main()
