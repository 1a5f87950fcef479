"""Elementary functions of arrays, as compiled loops."""

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evoros.base.arrays import Array
from evoros.base.elementary.inverse import atan2
from evoros.base.elementary.trigonometry import sin_cos


def sin_all(angles: NDArray[np.floating[Any]]) -> Array:
    """Return the sine of each angle [rad]."""
    return _sin_cos_all(angles)[0]


def cos_all(angles: NDArray[np.floating[Any]]) -> Array:
    """Return the cosine of each angle [rad]."""
    return _sin_cos_all(angles)[1]


def _sin_cos_all(angles: NDArray[np.floating[Any]]) -> tuple[Array, Array]:
    flat = np.array(angles, dtype=np.float64).ravel()
    sines, cosines = np.empty((2, flat.size))
    _compiled(_fill_sin_cos)(flat, sines, cosines)
    return sines.reshape(angles.shape), cosines.reshape(angles.shape)


def atan2_all(y: Array, x: Array) -> Array:
    """Return the angle [rad] of each point (x, y), for arrays of equal shape."""
    flat = np.array([y, x], dtype=np.float64).reshape(2, -1)
    angles = np.empty(flat.shape[1])
    _compiled(_fill_atan2)(*flat, angles)
    return angles.reshape(y.shape)


def compile_all() -> None:
    """Compile both loops."""
    for loop in (_fill_sin_cos, _fill_atan2):
        _compiled(loop)


@cache
def _compiled(function: Any) -> Any:
    # Imported here because numba imports slowly and most commands need no arrays.
    from numba import types

    from evoros.compilation.machine_code import compile_function, compiling

    array = types.Array(types.float64, 1, "C")
    with compiling() as on_disk:
        return compile_function(function, types.void(array, array, array), on_disk)


def _fill_sin_cos(angles: Array, sines: Array, cosines: Array) -> None:
    for i in range(len(angles)):
        sines[i], cosines[i] = sin_cos(angles[i])


def _fill_atan2(y: Array, x: Array, angles: Array) -> None:
    for i in range(len(angles)):
        angles[i] = atan2(y[i], x[i])
