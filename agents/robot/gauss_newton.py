"""The sums of a Gauss-Newton step over pixels.

They are compiled, not left to BLAS: its threads take thirty times as long where other work keeps the cores busy.

An axis has `D` parameters, which move the points of the `P` x `Q` pixels along it; one more parameter follows.
"""

from __future__ import annotations

import numpy as np

from mazebench.kernels import compiled


@compiled
def normal_equations(
    basis: np.ndarray, slopes: np.ndarray, differences: np.ndarray, deviations: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Returns the Gauss-Newton approximation of the Hessian, `[2 D + 1, 2 D + 1]`, and the gradient, `[2 D + 1]`.

    Args:
      basis: `[2, P Q, D]` float, by how much each parameter of an axis moves the points along it.
      slopes: `[P, Q, 3]` float, the derivatives of a pixel's value by its point's row and column, and by the last
        parameter.
      differences: `[P, Q]` float, of the pixels' values and what is expected.
      deviations: `[P, Q]` float, the standard deviations of the differences.
    """
    count, width = basis.shape[2], differences.shape[1]
    hessian, gradient = np.zeros((2 * count + 1, 2 * count + 1)), np.zeros(2 * count + 1)
    row = np.empty(2 * count + 1)  # a pixel's row of the Jacobian
    for pixel in range(basis.shape[1]):
        p, q = pixel // width, pixel % width
        slope = slopes[p, q] / deviations[p, q]
        if not slope.any():
            continue
        for d in range(count):
            row[d] = slope[0] * basis[0, pixel, d]
            row[count + d] = slope[1] * basis[1, pixel, d]
        row[-1] = slope[2]
        for d in range(len(row)):
            gradient[d] += row[d] * differences[p, q] / deviations[p, q]
            for other in range(d + 1):
                hessian[d, other] += row[d] * row[other]
    for d in range(len(row)):
        for other in range(d):
            hessian[other, d] = hessian[d, other]
    return hessian, gradient


@compiled
def inverse(matrix: np.ndarray) -> np.ndarray:
    """Returns the inverse of `matrix`, `[D, D]` float, symmetric and positive definite, by Gauss-Jordan elimination."""
    result = matrix.copy()
    for pivot in range(len(result)):
        scale = 1.0 / result[pivot, pivot]
        result[pivot, pivot] = 1.0
        for column in range(len(result)):
            result[pivot, column] *= scale
        for row in range(len(result)):
            if row != pivot:
                factor = result[row, pivot]
                result[row, pivot] = 0.0
                for column in range(len(result)):
                    result[row, column] -= factor * result[pivot, column]
    return result


@compiled
def variances(basis: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Returns `[P Q, 2]` float: the variances of the points along both axes.

    `covariance` is `[2 D + 1, 2 D + 1]` float, that of the parameters; for `basis` see `normal_equations`.
    """
    num_pixels, count = basis.shape[1:]
    result = np.zeros((num_pixels, 2))
    weighted = np.empty(count)  # a row of the basis times the covariance
    for axis in range(2):
        own = np.ascontiguousarray(covariance[axis * count : (axis + 1) * count, axis * count : (axis + 1) * count])
        for pixel in range(num_pixels):
            weighted[:] = 0.0
            for d in range(count):
                for other in range(count):
                    weighted[other] += basis[axis, pixel, d] * own[d, other]
            for d in range(count):
                result[pixel, axis] += weighted[d] * basis[axis, pixel, d]
    return result
