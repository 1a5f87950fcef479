"""The arrays that parts exchange, and reproducible products of small matrices.

Parts (robots, worlds, filters, controllers ...) are frozen descriptions. Their ``start()`` or
``open()`` creates the mutable state of a mission. During the mission, *rules* run: plain functions
of arrays, with parameters and memory in named tuples of numbers and float64 arrays. A rule never
allocates, never raises and stores nothing outside its arrays, so the same source can be interpreted
or compiled. Write ``x * x`` in rules, because ``x ** 2`` and numpy reductions give different bits
when compiled.

Units are SI: metres, seconds, radians, kilograms; a name that ends in ``_deg`` is in degrees. World
frame: z up. Robot frame: x forward, y left, yaw positive to the left.
"""

import math
from typing import Annotated, TypeAlias

import numpy as np
from numpy.typing import NDArray

from evoros.base.compilable import compilable

Array: TypeAlias = NDArray[np.float64]  # float64; docstrings state shape, as (n, 3), and units
Matrix: TypeAlias = Annotated[Array, "two dimensions"]  # two-dimensional, in rules' arguments

NO_VALUES: Array = np.zeros(0)

# The state of the robot: a float64 array of STATE_SIZE values, world frame.
X, Y, YAW, SPEED, YAW_RATE, CONTACT = range(6)
"""x [m], y [m], yaw [rad], forward speed [m/s], yaw rate [rad/s], 1 while touching an obstacle."""
STATE_SIZE = 6
POSE_SIZE = 4  # x, y, yaw and speed of a localized pose

# The current leg of the route: a float64 array of LEG_SIZE values [m].
FROM_X, FROM_Y, TO_X, TO_Y = range(4)
LEG_SIZE = 4

# The command of a controller: a float64 array of COMMAND_SIZE values.
DRIVE_SPEED, STEERING = range(2)  # [m/s] at the rear axle; bicycle model's angle [rad], left > 0
COMMAND_SIZE = 2

# The strengths of a robot's wheels: a float64 array of STRENGTH_SIZE values. If wheels can fail,
# the strengths of all robots follow their drive commands.
LEFT_WHEELS, RIGHT_WHEELS = range(2)  # fraction of the commanded wheel speed per side, 0 to 1
STRENGTH_SIZE = 2


@compilable
def copy_values(source: Array, target: Array) -> None:
    """Fill ``target`` with the first values of ``source``."""
    # numba compiles this loop ten times as fast as target[:] = source.
    for i in range(len(target)):
        target[i] = source[i]


_SWEEPS = 30  # maximum number of sweeps; Jacobi's method usually converges in five


def product(a: Array, b: Array) -> Array:
    """Return the matrix product of ``a`` (..., k) and ``b`` (k,) or (k, m), summed in order."""
    total: Array
    if b.ndim == 1:
        total = a[..., 0] * b[0]
        for i in range(1, len(b)):
            total = total + a[..., i] * b[i]
    else:
        total = a[..., :1] * b[0]
        for i in range(1, len(b)):
            total = total + a[..., i : i + 1] * b[i]
    return total


def length(vector: Array) -> float:
    """Return the Euclidean length of a vector (n,)."""
    return math.sqrt((vector * vector).sum())


def determinant(matrices: Array) -> Array:
    """Return the determinants of matrices (..., 3, 3)."""
    a, b, c = (matrices[..., i, :] for i in range(3))
    determinants: Array = (a * np.cross(b, c)).sum(axis=-1)
    return determinants


def principal_axes(tensor: Array) -> tuple[Array, Array]:
    """Return eigenvalues (3,), ascending, and right-handed eigenvectors of a symmetric matrix."""
    a = np.array(tensor, dtype=np.float64).tolist()
    axes = np.eye(3).tolist()
    for _ in range(_SWEEPS):
        if a[0][1] == a[0][2] == a[1][2] == 0.0:
            break
        for p, q in ((0, 1), (0, 2), (1, 2)):
            _rotate(a, axes, p, q)
    moments = np.array([a[i][i] for i in range(3)])
    order = np.argsort(moments, kind="stable")
    vectors = np.array(axes)[:, order]
    vectors *= np.where(vectors[np.abs(vectors).argmax(axis=0), range(3)] < 0.0, -1.0, 1.0)
    vectors[:, 2] *= math.copysign(1.0, float(determinant(vectors)))
    return moments[order], vectors


def _rotate(a: "list[list[float]]", axes: "list[list[float]]", p: int, q: int) -> None:
    """Rotate ``a`` and ``axes`` to make element (p, q) zero."""
    across = a[p][q]
    if abs(across) <= 1e-18 * math.sqrt(abs(a[p][p] * a[q][q])):
        a[p][q] = a[q][p] = 0.0
        return
    theta = (a[q][q] - a[p][p]) / (2.0 * across)
    t = math.copysign(1.0 / (abs(theta) + math.sqrt(theta * theta + 1.0)), theta)
    c = 1.0 / math.sqrt(t * t + 1.0)
    s = t * c
    r = 3 - p - q
    rp, rq = a[r][p], a[r][q]
    a[p][p] -= t * across
    a[q][q] += t * across
    a[p][q] = a[q][p] = 0.0
    a[r][p] = a[p][r] = c * rp - s * rq
    a[r][q] = a[q][r] = s * rp + c * rq
    for row in axes:
        row[p], row[q] = c * row[p] - s * row[q], s * row[p] + c * row[q]
