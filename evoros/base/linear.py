"""Products and axes of small matrices, with the same bits on every processor.

numpy uses BLAS and LAPACK, whose order of summation depends on the processor.
"""

import math

import numpy as np

from evoros.base.arrays import Array

_SWEEPS = 30  # maximum; Jacobi's method usually needs five


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
    """Return the length of a vector (n,)."""
    return math.sqrt((vector * vector).sum())


def determinant(matrices: Array) -> Array:
    """Return the determinants of matrices (..., 3, 3)."""
    a, b, c = (matrices[..., i, :] for i in range(3))
    determinants: Array = (a * np.cross(b, c)).sum(axis=-1)
    return determinants


def principal_axes(tensor: Array) -> tuple[Array, Array]:
    """Return the eigenvalues (3,) of a symmetric matrix (3, 3), ascending, and its eigenvectors.

    The eigenvectors are the columns of a right-handed rotation (3, 3), found by Jacobi's method.
    """
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
    """Rotate ``a`` and ``axes`` so that the element (p, q) becomes zero."""
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
